/* SPDX-License-Identifier: MIT */
#include "port/linux/socketcan.h"
#include "core/servo/safety.h"
#include "port/host/util.h"
#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define MAX_FILTERS 128u
#define CONTROL_BYTES (CMSG_SPACE(sizeof(uint32_t)) + CMSG_SPACE(sizeof(struct timespec)))

bool can_filter_to(const can_port *port, const palp_can_filter *f, uint32_t count) {
    struct can_filter raw[MAX_FILTERS];
    if (count > MAX_FILTERS) return false;
    for (uint32_t i = 0; i < count; i++) {
        bool extended = (f[i].flags & PALP_CAN_EXTENDED) != 0;
        raw[i] = (struct can_filter){.can_id = f[i].id | (extended ? CAN_EFF_FLAG : 0),
                                     .can_mask = f[i].mask | CAN_EFF_FLAG | CAN_RTR_FLAG};
    }
    return count == 0 ||
           setsockopt(port->fd, SOL_CAN_RAW, CAN_RAW_FILTER, raw, count * sizeof raw[0]) == 0;
}

/* The interface's index, after making sure that it can carry what is asked. */
static int find_interface(int fd, const char *interface, bool fd_frames) {
    struct ifreq request = {0};
    if (strlen(interface) >= sizeof request.ifr_name)
        die(EXIT_USAGE, "--bus: '%s' is no interface name", interface);
    memcpy(request.ifr_name, interface, strlen(interface));
    if (ioctl(fd, SIOCGIFMTU, &request) < 0) {
        die(EXIT_USAGE,
            "--bus: no interface '%s': create it, for example 'ip link add %s type vcan && ip link "
            "set %s up'",
            interface, interface, interface);
    }
    if (fd_frames && request.ifr_mtu < (int)CANFD_MTU)
        die(EXIT_USAGE,
            "--bus: '%s' carries classic CAN only and the device needs FD: 'ip link set %s type "
            "can "
            "bitrate 1000000 dbitrate 5000000 fd on', or for vcan 'ip link set %s mtu 72'",
            interface, interface, interface);
    if (ioctl(fd, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) == 0)
        die(EXIT_USAGE, "--bus: '%s' is down: 'ip link set %s up'", interface, interface);
    if (ioctl(fd, SIOCGIFINDEX, &request) < 0)
        die(EXIT_WORK, "--bus: '%s' has no index: %s", interface, strerror(errno));
    return request.ifr_ifindex;
}

can_port can_open(const char *interface, bool fd_frames, const palp_can_filter *filter,
                  uint32_t count) {
    can_err_mask_t errors =
        CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_ACK | CAN_ERR_TX_TIMEOUT;
    const int on = 1;
    can_port p = {.name = interface};
    p.fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (p.fd < 0)
        die(EXIT_USAGE, "no SocketCAN in this kernel (%s): load can_raw, or use --bus loop",
            strerror(errno));
    p.index = find_interface(p.fd, interface, fd_frames);
    if (!can_filter_to(&p, filter, count))
        die(EXIT_WORK, "receive filters were refused: %s", strerror(errno));
    if (fd_frames && setsockopt(p.fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0)
        die(EXIT_WORK, "--bus: the kernel refuses CAN FD frames: %s", strerror(errno));
    setsockopt(p.fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    setsockopt(p.fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    setsockopt(p.fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    return p;
}

bool can_listen(can_port *port) {
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = port->index};
    if (bind(port->fd, (struct sockaddr *)&address, sizeof address) == 0) return true;
    port->events |= PALP_EVENT_BUS_DOWN;
    return false;
}

/* The message's time stamp, 0 without one; notes what the kernel has dropped. */
static double read_control(can_port *p, struct msghdr *message) {
    double time_s = 0;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c != NULL; c = CMSG_NXTHDR(message, c)) {
        if (c->cmsg_level != SOL_SOCKET) continue;
        if (c->cmsg_type == SO_RXQ_OVFL) {
            uint32_t dropped;
            memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
            if (dropped != p->dropped) p->events |= PALP_EVENT_OVERFLOW;
            p->dropped = dropped;
        } else if (c->cmsg_type == SO_TIMESTAMPNS) {
            struct timespec t;
            memcpy(&t, CMSG_DATA(c), sizeof t);
            time_s = (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
        }
    }
    return time_s;
}

static void take_error(can_port *p, const struct canfd_frame *f) {
    const uint8_t overflow = CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW;
    const uint8_t warning = CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING |
                            CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
    if ((f->can_id & CAN_ERR_BUSOFF) != 0) p->events |= PALP_EVENT_BUS_OFF;
    /* The controller has been bus-off, even if that was not seen: what was queued is gone. */
    if ((f->can_id & CAN_ERR_RESTARTED) != 0) p->events |= PALP_EVENT_BUS_OFF;
    if ((f->can_id & (CAN_ERR_ACK | CAN_ERR_TX_TIMEOUT)) != 0) p->events |= PALP_EVENT_BUS_WARNING;
    if ((f->can_id & CAN_ERR_CRTL) != 0) {
        if ((f->data[1] & overflow) != 0) p->events |= PALP_EVENT_OVERFLOW;
        if ((f->data[1] & warning) != 0) p->events |= PALP_EVENT_BUS_WARNING;
    }
}

static palp_can_frame from_raw(const struct canfd_frame *raw, bool fd) {
    bool extended = (raw->can_id & CAN_EFF_FLAG) != 0;
    uint8_t most = fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN;
    palp_can_frame f = {.id = raw->can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK),
                        .length = raw->len > most ? most : raw->len};
    if (extended) f.flags |= PALP_CAN_EXTENDED;
    if (fd) f.flags |= PALP_CAN_FD;
    if ((raw->can_id & CAN_RTR_FLAG) != 0) f.flags |= PALP_CAN_REMOTE;
    memcpy(f.data, raw->data, f.length);
    return f;
}

static uint32_t event_of(int error) {
    if (error == EAGAIN || error == EWOULDBLOCK || error == EINTR) return 0;
    return error == ENOBUFS ? PALP_EVENT_BUS_FULL : PALP_EVENT_BUS_DOWN;
}

/* One batch; returns how many messages came, and adds data frames to `frames`. */
static uint32_t receive_batch(can_port *p, palp_can_frame *frames, double *time_s,
                              uint32_t capacity, uint32_t *n) {
    struct canfd_frame raw[CAN_BATCH];
    struct iovec data[CAN_BATCH];
    struct mmsghdr message[CAN_BATCH];
    _Alignas(struct cmsghdr) char control[CAN_BATCH][CONTROL_BYTES];
    uint32_t want = capacity - *n < CAN_BATCH ? capacity - *n : CAN_BATCH;
    for (uint32_t i = 0; i < want; i++) {
        data[i] = (struct iovec){.iov_base = &raw[i], .iov_len = sizeof raw[i]};
        message[i] = (struct mmsghdr){.msg_hdr = {.msg_iov = &data[i],
                                                  .msg_iovlen = 1,
                                                  .msg_control = control[i],
                                                  .msg_controllen = CONTROL_BYTES}};
    }
    int got = recvmmsg(p->fd, message, want, MSG_DONTWAIT, NULL);
    if (got < 0) {
        p->events |= event_of(errno);
        return 0;
    }
    for (int i = 0; i < got; i++) {
        double stamp_s = read_control(p, &message[i].msg_hdr);
        if ((raw[i].can_id & CAN_ERR_FLAG) != 0) {
            take_error(p, &raw[i]);
            continue;
        }
        if (time_s != NULL) time_s[*n] = stamp_s;
        frames[(*n)++] = from_raw(&raw[i], message[i].msg_len == CANFD_MTU);
    }
    return (uint32_t)got;
}

uint32_t can_receive(can_port *port, palp_can_frame *frames, double *time_s, uint32_t capacity) {
    uint32_t n = 0;
    for (uint32_t batch = 0; batch <= capacity / CAN_BATCH && n < capacity; batch++) {
        if (receive_batch(port, frames, time_s, capacity, &n) < CAN_BATCH) break;
    }
    return n;
}

void can_drain(can_port *port) {
    palp_can_frame frames[CAN_BATCH];
    for (int i = 0; i < 1000; i++) {
        if (can_receive(port, frames, NULL, CAN_BATCH) == 0) return;
    }
}

bool can_send(can_port *port, const palp_can_frame *frame) {
    bool fd = (frame->flags & PALP_CAN_FD) != 0;
    struct canfd_frame raw = {.can_id = frame->id, .len = frame->length};
    if ((frame->flags & PALP_CAN_EXTENDED) != 0) raw.can_id |= CAN_EFF_FLAG;
    if ((frame->flags & PALP_CAN_REMOTE) != 0) raw.can_id |= CAN_RTR_FLAG;
    if ((frame->flags & PALP_CAN_ERROR) != 0) raw.can_id |= CAN_ERR_FLAG; /* vcan only: simulated */
    if (fd) raw.flags = CANFD_BRS;
    memcpy(raw.data, frame->data, frame->length);
    ssize_t size = (ssize_t)(fd ? CANFD_MTU : CAN_MTU);
    port->sent++;
    if (write(port->fd, &raw, (size_t)size) == size) return true;
    port->lost++;
    port->events |= errno == EAGAIN ? PALP_EVENT_BUS_FULL : event_of(errno);
    return false;
}

bool can_wait(const can_port *port, int timeout_ms) {
    struct pollfd p = {.fd = port->fd, .events = POLLIN};
    return poll(&p, 1, timeout_ms) > 0;
}
