# SPDX-License-Identifier: MIT
# The processors that the library is built for by name (make lib TARGET=NAME): compiler prefix and flags of each,
# those that the shipped cost tables were counted with (tests/wcet/cases.sh).
TARGETS := x86-64 x86-64-avx2 cortex-a53 cortex-m7 cortex-m55
PREFIX_x86-64 :=
FLAGS_x86-64 :=
PREFIX_x86-64-avx2 :=
FLAGS_x86-64-avx2 := -mavx2
PREFIX_cortex-a53 := aarch64-linux-gnu-
FLAGS_cortex-a53 :=
PREFIX_cortex-m7 := arm-none-eabi-
FLAGS_cortex-m7 := -mthumb -mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard
PREFIX_cortex-m55 := arm-none-eabi-
FLAGS_cortex-m55 := -mthumb -mcpu=cortex-m55 -mfloat-abi=hard
