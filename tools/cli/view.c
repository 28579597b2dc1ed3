/* SPDX-License-Identifier: MIT */
/* palp view: the interactive page, with a body, scene or log of this machine, on 127.0.0.1. */
#include "port/host/args.h"
#include "core/base/crc32c.h"
#include "core/blob/format.h"
#include "port/host/record.h"
#include "port/host/util.h"
#include "tools/cli/commands.h"
#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define DEFAULT_PORT 8377u
#define PORTS 20u /* tried from there on, when none is asked for */
#define MOST_FILES 32u
#define MOST_REQUEST 8192u
#define PATIENCE_MS 2000 /* with a browser that says nothing */

static const char help[] =
    "usage: palp view [BLOB|SCENE|LOG [BLOB|SCENE]] [FILE.tool] [--port N]\n"
    "\n"
    "Serves a page on 127.0.0.1 on which a body is seen and touched, with the mouse, a finger or "
    "keys, by the "
    "controller's own\n"
    "code in the browser; a log is replayed there. Without a file: the page alone, on which files "
    "can be "
    "dropped.\n"
    "Prints the address and runs until it is interrupted. Nobody else on the network can reach "
    "it.\n"
    "\n"
    "  --port N    default: 8377, or the next that is free\n";

static const option options[] = {{"--port", 1}, {NULL, 0}};

extern const char palp_page[], palp_page_end[];
static const char *const page[2] = {palp_page, palp_page_end}; /* from, to */

typedef struct {
    const char *name, *path; /* as the page calls it; as it is here */
} served_file;

typedef struct {
    uint32_t port, files;
    bool port_given;
    served_file file[MOST_FILES];
} view_spec;

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number) {
    (void)number;
    interrupted = 1;
}

static const char *base_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash != NULL ? slash + 1 : path;
}

/* As the page is to call a file: it knows kinds by their endings, so a blob or log with another gets one. */
static const char *name_for_page(const char *path) {
    static const char *const known[] = {".palp", ".scene", ".log", ".tool", ".dev",
                                        ".hand", ".stl",   ".obj", ".ply"};
    const char *name = base_name(path), *end = NULL;
    char first[64] = "";
    FILE *f = fopen(path, "rb");
    const size_t n = f != NULL ? fread(first, 1, sizeof first - 1, f) : 0;
    if (f == NULL || (n == 0 && ferror(f)))
        die(EXIT_USAGE, "cannot read %s: %s", path, strerror(errno));
    fclose(f);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (has_extension(path, known[i])) return name;
    if (strncmp(first, PALP_BLOB_MAGIC, strlen(PALP_BLOB_MAGIC)) == 0) end = ".palp";
    if (first[0] == '(' && strstr(first, " palp ") != NULL) end = ".log";
    if (end == NULL)
        die(EXIT_USAGE, "%s: neither a blob, a scene, a tool, a mesh nor a log of palpd", path);
    char *named = allocate(strlen(name) + 8, 1);
    sprintf(named, "%s%s", name, end);
    return named;
}

/* One more file for the page; the same one again is nothing. */
static void serve(view_spec *s, const char *path) {
    const char *name = name_for_page(path);
    for (uint32_t i = 0; i < s->files; i++) {
        if (strcmp(s->file[i].name, name) != 0) continue;
        if (strcmp(s->file[i].path, path) == 0) return;
        die(EXIT_USAGE, "%s and %s have one name, which the page could not tell apart: rename one",
            s->file[i].path, path);
    }
    if (s->files == MOST_FILES) die(EXIT_USAGE, "at most %u files", MOST_FILES);
    s->file[s->files++] = (served_file){.name = name, .path = path};
}

static void serve_scene(view_spec *s, const char *path) {
    const scene_file *scene = scene_read(path); /* kept: it has the paths */
    for (uint32_t b = 0; b < scene->bodies; b++) serve(s, scene->body[b].path);
    for (uint32_t t = 0; t < scene->tools; t++)
        if (scene->tool[t].path[0] != '\0') serve(s, scene->tool[t].path);
    for (uint32_t d = 0; d < scene->devices; d++) {
        if (has_extension(scene->device[d].name, ".dev")) serve(s, scene->device[d].name);
        if (has_extension(scene->device[d].hand, ".hand")) serve(s, scene->device[d].hand);
    }
}

/* ---- the blob of a log ---- */

/* Whether a file is that of so many bytes and this CRC. */
static bool is_file(const char *path, uint32_t bytes, uint32_t crc) {
    struct stat status;
    if (stat(path, &status) != 0 || !S_ISREG(status.st_mode) || status.st_size != (off_t)bytes)
        return false;
    size_t read;
    char *data = read_file(path, &read);
    const bool same = read == bytes && palp_crc32c(0, data, read) == crc;
    free(data);
    return same;
}

/* The file in the log's folder that its session was recorded with. */
static void serve_blob_of(view_spec *s, const char *log) {
    session_record session;
    record_close(record_open(log, &session));
    if (session.scene->bodies > 1 || session.tool_bytes[0] > 0)
        die(EXIT_USAGE,
            "%s was recorded with several bodies or a tool of its own: name its scene behind it",
            log);
    char *folder = copy_string(log), *slash = strrchr(folder, '/');
    if (slash != NULL)
        slash[1] = '\0';
    else
        strcpy(folder, ""); /* it fits: a name is not empty */
    DIR *d = opendir(folder[0] != '\0' ? folder : ".");
    for (struct dirent *e; d != NULL && (e = readdir(d)) != NULL;) {
        char path[4096];
        snprintf(path, sizeof path, "%s%s", folder, e->d_name);
        if (!has_extension(path, ".palp") ||
            !is_file(path, session.blob_bytes[0], session.blob_crc[0]))
            continue;
        closedir(d);
        serve(s, copy_string(path));
        return;
    }
    die(EXIT_USAGE,
        "%s: its blob, of %" PRIu32 " bytes and CRC %08" PRIX32
        ", is not beside it: name it behind the log",
        log, session.blob_bytes[0], session.blob_crc[0]);
}

static void set_option(void *context, const argument *a) {
    view_spec *s = context;
    if (a->option != NULL) {
        s->port = arg_u32(a, 0, 1, 65535);
        s->port_given = true;
        return;
    }
    serve(s, a->value[0]);
    if (scene_is_here(a->value[0])) serve_scene(s, a->value[0]);
}

/* A socket on 127.0.0.1, on the port that was asked for or one near the default. */
static int listen_on(view_spec *s) {
    const uint32_t last = s->port_given ? s->port : s->port + PORTS - 1u;
    for (;; s->port++) {
        const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), yes = 1;
        if (fd < 0) die(EXIT_WORK, "no socket: %s", strerror(errno));
        setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
        struct sockaddr_in at = {.sin_family = AF_INET,
                                 .sin_port = htons((uint16_t)s->port),
                                 .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
        if (bind(fd, (struct sockaddr *)&at, sizeof at) == 0 && listen(fd, 16) == 0) return fd;
        const int why = errno;
        close(fd);
        if (s->port < last) continue;
        die(EXIT_WORK, "cannot serve on 127.0.0.1:%" PRIu32 ": %s: choose another --port", s->port,
            strerror(why));
    }
}

static bool send_all(int fd, const char *data, size_t bytes) {
    while (bytes > 0) {
        const ssize_t n = send(fd, data, bytes, MSG_NOSIGNAL);
        if (n < 0 && errno == EINTR && !interrupted) continue;
        if (n <= 0) return false;
        data += n;
        bytes -= (size_t)n;
    }
    return true;
}

static void answer(int fd, bool head_only, const char *status, const char *type, const char *body,
                   size_t bytes) {
    char head[256];
    const int n = snprintf(head, sizeof head,
                           "HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n"
                           "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
                           "Connection: close\r\n\r\n",
                           status, type, bytes);
    if (send_all(fd, head, (size_t)n) && !head_only) (void)send_all(fd, body, bytes);
}

static void refuse(int fd, const char *status) {
    answer(fd, false, status, "text/plain", status, strlen(status));
}

/* The text of an address, %xx decoded, in place. */
static void decode(char *text) {
    char *to = text;
    for (const char *from = text; *from != '\0'; from++) {
        unsigned value;
        if (*from == '%' && sscanf(from + 1, "%2x", &value) == 1 && value != 0) {
            *to++ = (char)value;
            from += 2;
        } else {
            *to++ = *from;
        }
    }
    *to = '\0';
}

static void put_names(FILE *f, const view_spec *s) {
    fputs("{\"files\": [", f);
    for (uint32_t i = 0; i < s->files; i++) {
        fputs(i > 0 ? ", \"" : "\"", f);
        for (const char *c = s->file[i].name; *c != '\0'; c++)
            fprintf(f, *c == '"' || *c == '\\' || (unsigned char)*c < 32 ? "\\u%04x" : "%c",
                    (unsigned char)*c);
        fputc('"', f);
    }
    fputs("]}\n", f);
}

/* Only a page of ours may ask: another site's would come with another Host. */
static bool is_ours(const char *request, uint32_t port) {
    char one[48], other[48];
    snprintf(one, sizeof one, "\r\nhost: 127.0.0.1:%" PRIu32 "\r\n", port);
    snprintf(other, sizeof other, "\r\nhost: localhost:%" PRIu32 "\r\n", port);
    return strcasestr(request, one) != NULL || strcasestr(request, other) != NULL;
}

static void answer_file(const view_spec *s, int fd, bool head_only, const char *name) {
    for (uint32_t i = 0; i < s->files; i++) {
        if (strcmp(s->file[i].name, name) != 0) continue;
        if (access(s->file[i].path, R_OK) != 0) break; /* gone since */
        size_t bytes;
        char *data = read_file(s->file[i].path, &bytes);
        answer(fd, head_only, "200 OK", "application/octet-stream", data, bytes);
        free(data);
        return;
    }
    refuse(fd, "404 Not Found");
}

static void answer_request(const view_spec *s, int fd, char *request) {
    char method[8] = "", path[1024] = "";
    if (sscanf(request, "%7s %1023s", method, path) != 2 || path[0] != '/') {
        refuse(fd, "400 Bad Request");
        return;
    }
    const bool head_only = strcmp(method, "HEAD") == 0;
    if (!head_only && strcmp(method, "GET") != 0) {
        refuse(fd, "405 Method Not Allowed");
        return;
    }
    if (!is_ours(request, s->port)) {
        refuse(fd, "403 Forbidden");
        return;
    }
    path[strcspn(path, "?#")] = '\0';
    decode(path);
    if (strcmp(path, "/") == 0 || strcmp(path, "/index.html") == 0) {
        answer(fd, head_only, "200 OK", "text/html; charset=utf-8", page[0],
               (size_t)(page[1] - page[0]));
    } else if (strcmp(path, "/start.json") == 0) {
        char *text = NULL;
        size_t bytes = 0;
        FILE *f = open_memory(&text, &bytes);
        put_names(f, s);
        fclose(f);
        answer(fd, head_only, "200 OK", "application/json", text, bytes);
        free(text);
    } else if (strncmp(path, "/files/", 7) == 0) {
        answer_file(s, fd, head_only, path + 7);
    } else {
        refuse(fd, "404 Not Found");
    }
}

static void take_request(const view_spec *s, int fd) {
    char request[MOST_REQUEST + 1];
    size_t used = 0;
    while (used < MOST_REQUEST) {
        struct pollfd p = {.fd = fd, .events = POLLIN};
        if (poll(&p, 1, PATIENCE_MS) <= 0) return;
        const ssize_t n = recv(fd, request + used, MOST_REQUEST - used, 0);
        if (n <= 0) return;
        used += (size_t)n;
        request[used] = '\0';
        if (strstr(request, "\r\n\r\n") == NULL) continue;
        answer_request(s, fd, request);
        return;
    }
    refuse(fd, "431 Request Header Fields Too Large");
}

int command_view(int argc, char **argv) {
    view_spec s = {.port = DEFAULT_PORT};
    args_parse(argc, argv, options, help, set_option, &s);
    if (page[1] == page[0])
        die(EXIT_WORK, "this palp was built without the page, for want of clang, lld or wasi-libc: "
                       "install them (make deps), and build it again");
    bool body = false;
    const char *log = NULL;
    for (uint32_t i = 0; i < s.files; i++) {
        body = body || has_extension(s.file[i].name, ".palp");
        if (has_extension(s.file[i].name, ".log")) log = s.file[i].path;
    }
    if (log != NULL && !body) serve_blob_of(&s, log);
    const int listener = listen_on(&s);
    const struct sigaction end = {.sa_handler = on_interrupt};
    sigaction(SIGINT, &end, NULL);
    sigaction(SIGTERM, &end, NULL);
    printf("http://127.0.0.1:%" PRIu32 "/\n", s.port);
    fflush(stdout);
    while (!interrupted) {
        const int fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC);
        if (fd < 0) continue;
        take_request(&s, fd);
        close(fd);
    }
    close(listener);
    return EXIT_SUCCESS;
}
