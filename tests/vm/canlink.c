/* SPDX-License-Identifier: MIT */
/* canlink NAME up|down|restart|config BITRATE RESTART_MS: what a ramdisk's `ip` does not know of
 * CAN. */
#include <errno.h>
#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

typedef struct {
    struct nlmsghdr head;
    struct ifinfomsg link;
    char attributes[512];
} request;

static struct rtattr *put(request *r, unsigned short type, const void *data, size_t bytes) {
    struct rtattr *a = (struct rtattr *)((char *)r + NLMSG_ALIGN(r->head.nlmsg_len));
    a->rta_type = type;
    a->rta_len = (unsigned short)RTA_LENGTH(bytes);
    if (bytes > 0) memcpy(RTA_DATA(a), data, bytes);
    r->head.nlmsg_len = NLMSG_ALIGN(r->head.nlmsg_len) + (unsigned)RTA_ALIGN(a->rta_len);
    return a;
}

static void close_nest(request *r, struct rtattr *nest) {
    nest->rta_len = (unsigned short)((char *)r + r->head.nlmsg_len - (char *)nest);
}

static int talk(request *r) {
    char answer[4096];
    int fd = socket(AF_NETLINK, SOCK_RAW, NETLINK_ROUTE);
    r->head.nlmsg_flags = NLM_F_REQUEST | NLM_F_ACK;
    if (fd < 0 || send(fd, r, r->head.nlmsg_len, 0) < 0) return errno;
    ssize_t n = recv(fd, answer, sizeof answer, 0);
    close(fd);
    const struct nlmsghdr *h = (const struct nlmsghdr *)answer;
    if (n <= 0 || h->nlmsg_type != NLMSG_ERROR) return EIO;
    return -((const struct nlmsgerr *)NLMSG_DATA(h))->error;
}

int main(int argc, char **argv) {
    request r = {.head = {.nlmsg_len = NLMSG_LENGTH(sizeof r.link), .nlmsg_type = RTM_NEWLINK}};
    if (argc < 3 || (r.link.ifi_index = (int)if_nametoindex(argv[1])) == 0) {
        fprintf(stderr, "canlink: no such interface\n");
        return 2;
    }
    if (strcmp(argv[2], "up") == 0 || strcmp(argv[2], "down") == 0) {
        r.link.ifi_change = IFF_UP;
        r.link.ifi_flags = argv[2][0] == 'u' ? IFF_UP : 0;
    } else {
        struct rtattr *info = put(&r, IFLA_LINKINFO, NULL, 0);
        put(&r, IFLA_INFO_KIND, "can", 3);
        struct rtattr *data = put(&r, IFLA_INFO_DATA, NULL, 0);
        if (strcmp(argv[2], "restart") == 0) {
            const unsigned now = 1;
            put(&r, IFLA_CAN_RESTART, &now, sizeof now);
        } else if (argc == 5) {
            const struct can_bittiming timing = {.bitrate = (unsigned)atoi(argv[3])};
            const unsigned restart_ms = (unsigned)atoi(argv[4]);
            if (timing.bitrate > 0) put(&r, IFLA_CAN_BITTIMING, &timing, sizeof timing);
            put(&r, IFLA_CAN_RESTART_MS, &restart_ms, sizeof restart_ms);
        }
        close_nest(&r, data);
        close_nest(&r, info);
    }
    int error = talk(&r);
    if (error != 0) fprintf(stderr, "canlink %s %s: %s\n", argv[1], argv[2], strerror(error));
    return error != 0;
}
