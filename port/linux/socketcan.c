/* SPDX-License-Identifier: MIT */
#include "socketcan.h"
#include "tools/util.h"
#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define MAX_FILTERS 16u

int can_open(const char *interface, const uint32_t *ids, uint32_t count, uint32_t mask) {
    struct can_filter filter[MAX_FILTERS];
    struct sockaddr_can address = {.can_family = AF_CAN};
    struct ifreq request = {0};
    can_err_mask_t errors = CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_ACK | CAN_ERR_TX_TIMEOUT;
    const int on = 1;
    int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (fd < 0)
        die(EXIT_USAGE, "no SocketCAN in this kernel (%s): load can_raw, or use --bus loop",
            strerror(errno));
    if (strlen(interface) >= sizeof request.ifr_name)
        die(EXIT_USAGE, "--bus: '%s' is no interface name", interface);
    memcpy(request.ifr_name, interface, strlen(interface));
    if (ioctl(fd, SIOCGIFINDEX, &request) < 0) {
        die(EXIT_USAGE,
            "--bus: no interface '%s': create it, for example 'ip link add %s type vcan && ip link "
            "set %s up'",
            interface, interface, interface);
    }
    address.can_ifindex = request.ifr_ifindex;
    for (uint32_t i = 0; i < count && i < MAX_FILTERS; i++) {
        filter[i] =
            (struct can_filter){.can_id = ids[i], .can_mask = mask | CAN_EFF_FLAG | CAN_RTR_FLAG};
    }
    if (count > 0) setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filter, count * sizeof filter[0]);
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    if (bind(fd, (struct sockaddr *)&address, sizeof address) < 0) {
        die(EXIT_WORK, "--bus: cannot bind to '%s': %s", interface, strerror(errno));
    }
    return fd;
}

/* One frame with the socket's drop counter; the length read, or -1. */
static ssize_t receive_one(int fd, struct can_frame *raw, can_health *health) {
    union {
        char bytes[CMSG_SPACE(sizeof(uint32_t))];
        struct cmsghdr align;
    } control;
    struct iovec data = {.iov_base = raw, .iov_len = sizeof *raw};
    struct msghdr message = {.msg_iov = &data,
                             .msg_iovlen = 1,
                             .msg_control = control.bytes,
                             .msg_controllen = sizeof control.bytes};
    ssize_t got = recvmsg(fd, &message, MSG_DONTWAIT);
    if (got < 0) return got;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&message); c != NULL; c = CMSG_NXTHDR(&message, c)) {
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&health->dropped, CMSG_DATA(c), sizeof health->dropped);
        }
    }
    return got;
}

uint32_t can_receive(int fd, palp_can_frame *frames, uint32_t capacity, can_health *health) {
    uint32_t n = 0;
    while (n < capacity) {
        struct can_frame raw;
        if (receive_one(fd, &raw, health) < 0) {
            if (errno != EAGAIN && errno != EWOULDBLOCK) health->failed = true;
            break;
        }
        if ((raw.can_id & CAN_ERR_FLAG) != 0) {
            if ((raw.can_id & CAN_ERR_BUSOFF) != 0) health->failed = true;
            continue;
        }
        bool extended = (raw.can_id & CAN_EFF_FLAG) != 0;
        palp_can_frame *f = &frames[n++];
        *f = (palp_can_frame){.id = raw.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK),
                              .length = raw.len > 8 ? 8 : raw.len};
        if (extended) f->flags |= PALP_CAN_EXTENDED;
        if ((raw.can_id & CAN_RTR_FLAG) != 0) f->flags |= PALP_CAN_REMOTE;
        memcpy(f->data, raw.data, f->length);
    }
    return n;
}

void can_drain(int fd) {
    struct can_frame raw;
    while (recv(fd, &raw, sizeof raw, MSG_DONTWAIT) > 0) continue;
}

bool can_send(int fd, const palp_can_frame *frame) {
    struct can_frame raw = {.can_id = frame->id, .len = frame->length};
    if ((frame->flags & PALP_CAN_EXTENDED) != 0) raw.can_id |= CAN_EFF_FLAG;
    if ((frame->flags & PALP_CAN_REMOTE) != 0) raw.can_id |= CAN_RTR_FLAG;
    memcpy(raw.data, frame->data, frame->length);
    return write(fd, &raw, sizeof raw) == (ssize_t)sizeof raw;
}
