# Palp: see README.md. `make help` lists the targets.
.DEFAULT_GOAL := all
.SECONDARY:
include core/targets.mk
TARGET ?=
ifneq ($(TARGET),)
ifeq ($(filter $(TARGET),$(TARGETS)),)
$(error no target '$(TARGET)': there are $(TARGETS))
endif
CROSS := $(PREFIX_$(TARGET))
BUILD ?= build/$(TARGET)
else ifneq ($(filter arm-none-eabi-%,$(CROSS)),)
$(error $(CROSS)gcc alone would build for ARMv4T without floating point: name a processor with TARGET=, one of $(TARGETS))
endif
CROSS ?=
BUILD ?= build$(if $(CROSS),/$(patsubst %-,%,$(CROSS)))
PREFIX ?= /usr/local
VERSION := $(shell sed -n 's/^\#define PALP_VERSION "\(.*\)"/\1/p' core/base/version.h)
CC := $(if $(CROSS),$(CROSS)gcc,$(if $(filter default,$(origin CC)),gcc,$(CC)))
AR := $(CROSS)ar

WARN := -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wdouble-promotion -Wfloat-equal \
        -Wstrict-prototypes -Wmissing-prototypes -Wundef -Wvla -Werror
OPTIMISE ?= -O3
INSTRUMENT ?= # flags of sanitizers, for compiler and linker
PLAIN ?= # folders that go without them
$(foreach p,$(PLAIN),$(eval $(BUILD)/$(p)/%.o: override INSTRUMENT := ))
SHARED = -std=c11 $(OPTIMISE) $(FLAGS_$(TARGET)) $(INSTRUMENT) -ffp-contract=off -fno-math-errno -I. $(WARN)
# no jump tables: tests/wcet/ipet reads the branches of the machine code
CORE_FLAGS = $(SHARED) -fno-trapping-math -ffreestanding -fno-jump-tables
HOST_FLAGS = $(SHARED) -D_GNU_SOURCE -pthread -Wno-psabi
DEPS = -MMD -MP

CORE := $(sort $(wildcard core/*/*.c))
HOST_LIB := $(sort $(wildcard port/host/*.c))
SIM_LIB := $(filter-out sim/palp_sim.c,$(sort $(wildcard sim/*.c)))
TOOLS_LIB := $(filter-out tools/cli/main.c tools/examples/%,$(sort $(wildcard tools/*/*.c)))
# Telemetry is built with Cyclone DDS where that is installed (never when cross-building).
DDS := $(if $(CROSS),,$(shell command -v idlc >/dev/null && pkg-config --exists CycloneDDS && echo yes))
DDS_UNUSED := port/linux/telemetry_$(if $(DDS),none,dds).c
DDS_LIBS := $(if $(DDS),$(shell pkg-config --libs CycloneDDS))
LINUX_LIB := $(filter-out port/linux/palpd.c $(DDS_UNUSED),$(sort $(wildcard port/linux/*.c)))
obj = $(patsubst %.c,$(BUILD)/%.o,$(1))
SHARED_OBJ := $(call obj,$(HOST_LIB) $(SIM_LIB)) $(BUILD)/devices.o $(BUILD)/assets.o
LINUX_OBJ := $(SHARED_OBJ) $(call obj,$(LINUX_LIB)) $(if $(DDS),$(BUILD)/dds/telemetry_idl.o)
PALP_OBJ := $(SHARED_OBJ) $(call obj,$(TOOLS_LIB)) $(BUILD)/page.o
HOST_OBJ := $(sort $(LINUX_OBJ) $(PALP_OBJ))
LIB := $(BUILD)/libpalp.a

.PHONY: all lib size wcet-proof campaign cortexm static demo demo-finger demo-dyna test check soak bench feel reproduce web pictures deps install deb clean help format
all: $(LIB) $(BUILD)/palp $(BUILD)/palpd $(BUILD)/palp-sim ## library, palp, palpd and palp-sim

lib: $(LIB) ## the library alone; TARGET=cortex-m7 and others of core/targets.mk: for that processor, build/TARGET/libpalp.a

$(BUILD)/core/%.o: core/%.c
	@mkdir -p $(@D)
	@echo '  CC $<'
	@$(CC) $(CORE_FLAGS) $(DEPS) -c $< -o $@
$(BUILD)/%.o: %.c
	@mkdir -p $(@D)
	@echo '  CC $<'
	@$(CC) $(HOST_FLAGS) $(DEPS) -c $< -o $@
$(LIB): $(call obj,$(CORE))
	@rm -f $@
	@echo '  AR $@'
	@$(AR) rcsD $@ $^
$(BUILD)/devices.c: $(sort $(wildcard sim/devices/*.dev)) sim/embed.sh
	@mkdir -p $(@D)
	@sh sim/embed.sh $(filter %.dev,$^) > $@
$(BUILD)/devices.o: $(BUILD)/devices.c
	@$(CC) $(HOST_FLAGS) -c $< -o $@

# Parts of pages, as they are.
$(BUILD)/assets.o: port/host/assets.S $(wildcard port/host/page/*)
	@mkdir -p $(@D)
	@$(CC) -c $< -o $@

# The page with its engine is the same whatever palp is built for; without clang for WebAssembly palp has none.
PAGE_DIR := build/page
WASM := $(shell [ -d /usr/lib/wasm32-wasi ] && command -v clang >/dev/null && command -v wasm-ld >/dev/null && echo yes)
PAGE_SOURCES := $(wildcard sim/web/*.js sim/web/*.css sim/web/*.html sim/web/build.sh port/host/page/*)
ENGINE_SOURCES := $(wildcard core/*/*.[ch] port/host/*.[ch] port/wasm/* sim/*.[ch] sim/web/*.[ch] tools/*/*.[ch])
$(PAGE_DIR)/engine.wasm: $(ENGINE_SOURCES) $(sort $(wildcard sim/devices/*.dev))
	@mkdir -p $(@D)
	@echo '  WASM $@'
	@sh sim/embed.sh $(filter %.dev,$^) > $(@D)/devices.c
	@sh port/wasm/build.sh $@ $(@D)/devices.c
$(PAGE_DIR)/page.html: $(PAGE_DIR)/engine.wasm $(PAGE_SOURCES)
	@sh sim/web/build.sh $@ $<
$(BUILD)/page.o: sim/web/page.S $(if $(WASM),$(PAGE_DIR)/page.html)
	@mkdir -p $(@D)
	@$(CC) $(if $(WASM),'-DPAGE="$(PAGE_DIR)/page.html"') -c $< -o $@

# What idlc makes is not held to our warnings.
$(BUILD)/dds/telemetry_idl.c: port/linux/telemetry.idl
	@mkdir -p $(@D)
	@cp $< $(@D)/telemetry_idl.idl && cd $(@D) && idlc -l c telemetry_idl.idl
$(BUILD)/dds/telemetry_idl.o: $(BUILD)/dds/telemetry_idl.c
	@$(CC) -O2 -w $(shell pkg-config --cflags CycloneDDS 2>/dev/null) -c $< -o $@
$(BUILD)/port/linux/telemetry_dds.o: $(BUILD)/dds/telemetry_idl.o
$(BUILD)/port/linux/telemetry_dds.o: HOST_FLAGS += -I$(BUILD)/dds $(shell pkg-config --cflags CycloneDDS 2>/dev/null)

$(BUILD)/palp: $(BUILD)/tools/cli/main.o $(PALP_OBJ) $(LIB)
	@echo '  LD $@'
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -lm -o $@
$(BUILD)/palpd: $(BUILD)/port/linux/palpd.o $(LINUX_OBJ) $(LIB)
	@echo '  LD $@'
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -lm -o $@
$(BUILD)/palp-sim: $(BUILD)/sim/palp_sim.o $(LINUX_OBJ) $(LIB)
	@echo '  LD $@'
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -lm -o $@

# For ramdisks: no libraries, no telemetry.
STATIC_OBJ = $(filter-out $(BUILD)/port/linux/telemetry_%.o $(BUILD)/dds/%,$(LINUX_OBJ)) $(BUILD)/port/linux/telemetry_none.o
static: $(BUILD)/static/palpd $(BUILD)/static/palp-sim ## palpd and palp-sim linked statically, for ramdisks
$(BUILD)/static/palpd: $(BUILD)/port/linux/palpd.o $(STATIC_OBJ) $(LIB)
	@mkdir -p $(@D)
	@$(CC) $(INSTRUMENT) -static -pthread $^ -lm -o $@
$(BUILD)/static/palp-sim: $(BUILD)/sim/palp_sim.o $(STATIC_OBJ) $(LIB)
	@mkdir -p $(@D)
	@$(CC) $(INSTRUMENT) -static -pthread $^ -lm -o $@

-include $(shell find $(BUILD) \( -path $(BUILD)/vm -o -path $(BUILD)/sanitized -o -path $(BUILD)/package-arm64 \) -prune -o -type f -name '*.d' -print 2>/dev/null)

# ---- demo ----

DEMO := $(BUILD)/demo
demo: all ## bake the sample rabbit and feel it for 10 s at 1 kHz: build/demo/report.html
	@mkdir -p $(DEMO)
	$(BUILD)/palp bake blobs/rabbit.model -o $(DEMO)/rabbit.palp
	$(BUILD)/palpd $(DEMO)/rabbit.palp --bus loop --device arm3 --seconds 10 --report $(DEMO)/report.html \
	    --view $(DEMO)/view.svg
	$(BUILD)/palpd sim/scenes/two_hands.scene --no-wait --report $(DEMO)/two_hands.html
	@echo "The same bake took nine hours on eight processors in 2002 (Table II of the paper)."
	@echo "Look at $(DEMO)/report.html, and $(DEMO)/two_hands.html: two hands that feel each other through the body"

demo-finger: all ## bake the three-pad finger and curl it about a cylinder, a new configuration each tick: build/finger/report.html
	@mkdir -p $(BUILD)/finger
	$(BUILD)/palp bake blobs/finger.model -o $(BUILD)/finger/finger.palp
	$(BUILD)/palp play $(BUILD)/finger/finger.palp --scene sim/finger.scene --ns-per-operation 0.25 --report $(BUILD)/finger/report.html -o $(BUILD)/finger/ticks.csv
	$(BUILD)/palpd sim/scenes/finger.scene --no-wait --report $(BUILD)/finger/felt.html
	@echo "Look at $(BUILD)/finger/report.html, and $(BUILD)/finger/felt.html: the finger closes on what a hand holds"

demo-dyna: all ## a liver-like body at three resolutions, poked, released, oscillating: build/dyna/report.html
	@mkdir -p $(BUILD)/dyna
	$(BUILD)/palp bake blobs/liver.model -o $(BUILD)/dyna/liver.palp
	$(BUILD)/palp play $(BUILD)/dyna/liver.palp --scene sim/liver.scene --ns-per-operation 0.15 --report $(BUILD)/dyna/report.html -o $(BUILD)/dyna/ticks.csv
	$(BUILD)/palpd sim/scenes/liver.scene --no-wait --report $(BUILD)/dyna/felt.html
	@echo "Look at $(BUILD)/dyna/report.html, and $(BUILD)/dyna/felt.html: felt by a hand; --material jelly, fat, muscle, gel, rubber or hard-rubber make it another"

WEB := build/web
web: all ## a folder that can be hosted anywhere or opened as one file: build/web/index.html
	@$(if $(WASM),,echo "no page without clang, lld and wasi-libc: make deps" >&2; exit 1)
	@mkdir -p $(WEB)
	@BUILD=$(BUILD) sh sim/web/models.sh $(WEB) $(PAGE_DIR)/engine.wasm

pictures: web ## README's pictures, taken of our own pages by a browser: sim/pictures
	@BUILD=$(BUILD) sh sim/web/pictures.sh sim/pictures

# ---- tests ----

UNIT := $(sort $(wildcard tests/unit/*.c))
UNIT_BIN := $(patsubst tests/unit/%.c,$(BUILD)/tests/%,$(UNIT))
$(BUILD)/tests/%: $(BUILD)/tests/unit/%.o $(BUILD)/tests/models.o $(BUILD)/tests/stage.o $(HOST_OBJ) $(LIB)
	@mkdir -p $(@D)
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -lm -o $@

CLI := $(patsubst %,tests/cli/%.sh,bad-input formats levels controller zones dynamic tools scenes wcet examples tutorial exports outputs)
test: all $(UNIT_BIN) ## every test that needs only what is installed; says what it skips
	@BUILD=$(BUILD) COUNTS=$(BUILD)/test.counts sh tests/run.sh tests/cli/feel.sh tests/freestanding.sh $(UNIT_BIN) $(CLI)

$(BUILD)/bench: $(BUILD)/tests/bench/bench.o $(BUILD)/tests/models.o $(HOST_OBJ) $(LIB)
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -ldl -lm -o $@
$(BUILD)/elements: $(BUILD)/tests/bench/elements.o $(BUILD)/tests/models.o $(HOST_OBJ) $(LIB)
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -lm -o $@
$(BUILD)/day: $(BUILD)/tests/soak/day.o $(HOST_OBJ) $(LIB)
	@$(CC) $(INSTRUMENT) -pthread $^ $(DDS_LIBS) -lm -o $@
bench: all $(BUILD)/bench $(BUILD)/elements ## fast against dense summation, side by side; also build/bench.json
	@$(BUILD)/palp subdivide blobs/rabbit.obj -o $(BUILD)/rabbit.obj --levels 3 > $(BUILD)/bench.log
	@$(BUILD)/bench $(BUILD)/rabbit.obj 0.004 $(BUILD)/bench.json
	@$(BUILD)/elements

feel: all ## the bench of felt quality on a ball, a box, a plate and the sample rabbit: build/feel
	@mkdir -p $(BUILD)/feel
	$(BUILD)/palp bake blobs/ball.obj --loop 2 --as-is --young 3e4 --poisson 0.45 --fix-below z -0.7 -o $(BUILD)/feel/ball.palp
	$(BUILD)/palp bake blobs/ball.obj --loop 3 --as-is --young 3e4 --poisson 0.45 --fix-below z -0.7 -o $(BUILD)/feel/ball-fine.palp
	$(BUILD)/palp feel $(BUILD)/feel/ball.palp --finer $(BUILD)/feel/ball-fine.palp -o $(BUILD)/feel/ball
	$(BUILD)/palp bake blobs/box.obj --as-is --young 3e4 --poisson 0.45 --fix-below z 1e-6 -o $(BUILD)/feel/box.palp
	$(BUILD)/palp feel $(BUILD)/feel/box.palp -o $(BUILD)/feel/box
	$(BUILD)/palp bake blobs/plate.obj --as-is --young 3e4 --poisson 0.45 --fix-below x 1e-6 -o $(BUILD)/feel/plate.palp
	$(BUILD)/palp feel $(BUILD)/feel/plate.palp -o $(BUILD)/feel/plate
	$(BUILD)/palp bake blobs/rabbit.model -o $(BUILD)/feel/rabbit.palp
	$(BUILD)/palp feel $(BUILD)/feel/rabbit.palp -o $(BUILD)/feel/rabbit

reproduce: all ## the paper's tables and figures from our own models: build/reproduce/index.html (about six minutes)
	$(BUILD)/palp reproduce blobs/bean.model blobs/large.model --dynamic blobs/liver.model -o $(BUILD)/reproduce

size: all ## code, data, deepest stack and memory of every target that can be built here
	@mkdir -p $(BUILD)/size
	@$(BUILD)/palp subdivide blobs/rabbit.obj -o $(BUILD)/size/rabbit.obj --levels 2 > /dev/null
	@$(BUILD)/palp bake $(BUILD)/size/rabbit.obj --as-is --young 3e4 --poisson 0.45 --fix-below z 0.004 -o $(BUILD)/size/rabbit.palp > /dev/null 2>&1
	@BUILD=$(BUILD) sh tests/size.sh $(BUILD)/size/rabbit.palp

wcet-proof: ## bounds derived from the machine code of four targets, against the formulas of core
	@BUILD=$(BUILD) sh tests/check/proof.sh

CASES ?= 1000000
campaign: all ## hours: CASES=1000000 counted cases of many bodies on each of four targets against their bounds
	@BUILD=$(BUILD) sh tests/wcet/campaign.sh $(CASES)

cortexm: all ## a bare Cortex-M7 image with the sample rabbit in flash, run under QEMU
	@mkdir -p $(BUILD)/cortexm
	@$(BUILD)/palp subdivide blobs/rabbit.obj -o $(BUILD)/cortexm/rabbit.obj --levels 2 > /dev/null
	@$(BUILD)/palp bake $(BUILD)/cortexm/rabbit.obj --as-is --young 3e4 --poisson 0.45 --fix-below z 0.004 \
	    -o $(BUILD)/cortexm/rabbit.palp > /dev/null 2>&1
	sh port/cortexm/build.sh $(BUILD)/cortexm/rabbit.palp $(BUILD)/cortexm/image.elf m7 -DRATE_HZ=75.0f
	qemu-system-arm -M mps2-an500 -nographic -monitor none -serial none -semihosting-config enable=on,target=native \
	    -icount shift=6 -kernel $(BUILD)/cortexm/image.elf

# ---- everything else ----

PACKAGES := gcc g++ clang make perl binutils valgrind gcc-arm-none-eabi libnewlib-arm-none-eabi gcc-aarch64-linux-gnu \
            libc6-dev-arm64-cross qemu-user-static qemu-system-x86 busybox-static cpio chromium python3 python3-numpy python3-meshio cppcheck \
            libopenblas0-pthread qemu-system-arm can-utils python3-can strace libclang-rt-14-dev pkg-config \
            cyclonedds-dev cyclonedds-tools calculix-ccx qemu-user glpk-utils llvm gcc-arm-linux-gnueabihf \
            libc6-dev-armhf-cross wasi-libc libclang-rt-14-dev-wasm32 lld nodejs
deps: ## install, with apt, the Debian packages of the full test run (root)
	apt-get update
	DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $(PACKAGES)

# The longest first: they run side by side.
CHECKS := $(patsubst %,tests/check/%.sh,sanitize vm wcet proof same-bits static zwidth dynamic fuzz package reproduce embedded solids shapes calculix dds finger logs realtime direct browser export day)
check: test $(BUILD)/elements $(BUILD)/day ## make test plus sanitizers, other targets, browser, numpy and virtual machine
	@BUILD=$(BUILD) BEFORE=$(BUILD)/test.counts sh tests/run.sh $(CHECKS)
soak: all $(UNIT_BIN) $(BUILD)/elements $(BUILD)/day ## what of make check is only long, in full: hours
	@BUILD=$(BUILD) TICKS=10000 PALP_SCALE=10 PALP_TICKS=10000000 PALP_SECONDS=100 PALP_POKES=100000 FUZZ_SECONDS=600 FULL=1 HOURS=24 DEVICES='arm3 delta3 pantograph desk3 arm3-mit' \
	    sh tests/run.sh $(BUILD)/tests/faults $(BUILD)/tests/energy $(patsubst %,tests/check/%.sh,vm sanitize wcet same-bits dynamic fuzz reproduce day zwidth)

install: all ## headers, library, palp.pc and programs to DESTDIR and PREFIX
	install -d $(DESTDIR)$(PREFIX)/bin $(DESTDIR)$(PREFIX)/lib/pkgconfig $(DESTDIR)$(PREFIX)/share/palp/devices
	install -m 755 $(BUILD)/palp $(BUILD)/palpd $(BUILD)/palp-sim $(DESTDIR)$(PREFIX)/bin
	install -m 644 $(LIB) $(DESTDIR)$(PREFIX)/lib
	install -m 644 sim/devices/*.dev core/device/*.dbc $(DESTDIR)$(PREFIX)/share/palp/devices
	for m in port/linux/man/*.?; do install -D -m 644 $$m $(DESTDIR)$(PREFIX)/share/man/man$${m##*.}/$${m##*/}; done
	for h in core/palp.h core/*/*.h; do install -D -m 644 $$h $(DESTDIR)$(PREFIX)/include/palp/$$h; done
	printf 'prefix=%s\nName: palp\nDescription: feel deformable objects in bounded time\nVersion: $(VERSION)\nCflags: -I$${prefix}/include/palp\nLibs: -L$${prefix}/lib -lpalp\n' \
	    $(PREFIX) > $(DESTDIR)$(PREFIX)/lib/pkgconfig/palp.pc

DEB_ARCH = $(if $(CROSS),$(patsubst aarch64,arm64,$(firstword $(subst -, ,$(CROSS)))),$(shell dpkg --print-architecture))
deb: all ## a Debian package: build/palp_VERSION_ARCH.deb
	@CROSS=$(CROSS) DDS=$(DDS) sh port/linux/deb.sh $(BUILD) $(DEB_ARCH) $(VERSION)

format: ## lay out every source file by .clang-format
	clang-format -i $$(git ls-files '*.c' '*.h')
clean: ## remove build/
	rm -rf $(BUILD)
help: ## this list
	@grep -hE '^[a-z-]+:.*## ' Makefile | sed 's/:.*## /\t/' | sort | awk -F'\t' '{printf "  make %-11s %s\n", $$1, $$2}'
