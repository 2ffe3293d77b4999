// A switch between the ends of veth pairs that takes its time and loses packets: the network between camera hosts and
// trackers, where the kernel has no netem. It learns who is where from the source addresses, as switches do.
//   slow_network [--no-multicast] DELAY_US LOST_PER_MILLION SEED INTERFACE...
// until a signal; then it prints how many packets it took and lost. Each packet waits DELAY_US on its way (a queue in
// order of arrival), then goes to the interface of its destination, or to all others. What is lost is drawn from SEED.
// --no-multicast: of IPv4 nothing goes to groups, as on many wireless and routed networks.
// As root.
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

// What the kernel says of a packet's checksum goes along with it: the ends of a veth pair leave it to be filled in.
#ifndef PACKET_IGNORE_OUTGOING
#define PACKET_IGNORE_OUTGOING 23
#endif
enum { most_ports = 32, most_known = 256, most_waiting = 1 << 15, header_bytes = 10, most_bytes = 65536 + 64 };

struct waiting {
  int64_t due_ns;
  int from;
  int bytes;
  uint8_t* packet;
};
static struct waiting queue[most_waiting];
static unsigned first, next;

static struct {
  uint8_t address[6];
  int port;
} known[most_known];
static int known_count;

static volatile sig_atomic_t ended;
static void on_signal(int signal) {
  (void)signal;
  ended = 1;
}

static int64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static int port_of(const uint8_t* address) {
  for (int i = 0; i < known_count; ++i)
    if (memcmp(known[i].address, address, 6) == 0) return known[i].port;
  return -1;
}

static void learn(const uint8_t* address, int port) {
  for (int i = 0; i < known_count; ++i)
    if (memcmp(known[i].address, address, 6) == 0) {
      known[i].port = port;
      return;
    }
  if (known_count == most_known) return;
  memcpy(known[known_count].address, address, 6);
  known[known_count++].port = port;
}

static int open_port(const char* name) {
  const int fd = socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK, htons(ETH_P_ALL));
  const int one = 1, bytes = 64 << 20;
  struct sockaddr_ll at = {
      .sll_family = AF_PACKET, .sll_protocol = htons(ETH_P_ALL), .sll_ifindex = (int)if_nametoindex(name)};
  struct packet_mreq all = {.mr_ifindex = at.sll_ifindex, .mr_type = PACKET_MR_PROMISC};
  if (fd < 0 || at.sll_ifindex == 0 || setsockopt(fd, SOL_PACKET, PACKET_VNET_HDR, &one, sizeof one) != 0 ||
      setsockopt(fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &one, sizeof one) != 0 ||
      bind(fd, (struct sockaddr*)&at, sizeof at) != 0 ||
      setsockopt(fd, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &all, sizeof all) != 0) {
    perror(name);
    exit(1);
  }
  setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes);
  setsockopt(fd, SOL_SOCKET, SO_SNDBUFFORCE, &bytes, sizeof bytes);
  return fd;
}

int main(int argc, char** argv) {
  const int no_multicast = argc > 1 && strcmp(argv[1], "--no-multicast") == 0;
  argc -= no_multicast, argv += no_multicast;
  if (argc < 6 || argc - 4 > most_ports) {
    fprintf(stderr, "slow_network [--no-multicast] DELAY_US LOST_PER_MILLION SEED INTERFACE INTERFACE...\n");
    return 2;
  }
  const int64_t delay_ns = atoll(argv[1]) * 1000;
  const double lost_share = 1e-6 * atof(argv[2]);
  srand48(atol(argv[3]));
  const int ports = argc - 4;
  struct pollfd polled[most_ports];
  for (int p = 0; p < ports; ++p) polled[p] = (struct pollfd){.fd = open_port(argv[4 + p]), .events = POLLIN};
  signal(SIGTERM, on_signal);
  signal(SIGINT, on_signal);
  prctl(PR_SET_TIMERSLACK, 1000UL);
  uint8_t buffer[most_bytes];
  unsigned long long took = 0, lost = 0, full = 0, refused = 0;
  while (!ended) {
    const int64_t now = now_ns();
    while (first != next && queue[first % most_waiting].due_ns <= now) {
      struct waiting* const w = &queue[first++ % most_waiting];
      const uint8_t* const to = w->packet + header_bytes;
      const int port = (to[0] & 1) ? -1 : port_of(to);
      for (int p = 0; p < ports; ++p)
        if (p != w->from && (port < 0 || p == port) && send(polled[p].fd, w->packet, (size_t)w->bytes, 0) < 0)
          ++refused;
      free(w->packet);
    }
    const int64_t wait_ns = first == next ? 100000000 : queue[first % most_waiting].due_ns - now;
    const struct timespec wait = {.tv_sec = 0, .tv_nsec = wait_ns > 0 ? wait_ns : 0};
    if (ppoll(polled, (nfds_t)ports, &wait, NULL) < 0 && errno != EINTR) break;
    const int64_t came_ns = now_ns();
    for (int p = 0; p < ports; ++p) {
      if (polled[p].revents == 0) continue;
      for (int n = 0; n < 64; ++n) {
        const ssize_t bytes = recv(polled[p].fd, buffer, sizeof buffer, 0);
        if (bytes < header_bytes + 14) break;
        ++took;
        learn(buffer + header_bytes + 6, p);
        if (no_multicast && buffer[header_bytes] == 0x01) continue;
        if (drand48() < lost_share) {
          ++lost;
          continue;
        }
        if (next - first == most_waiting) {
          ++full;
          continue;
        }
        struct waiting* const w = &queue[next++ % most_waiting];
        *w = (struct waiting){
            .due_ns = came_ns + delay_ns, .from = p, .bytes = (int)bytes, .packet = malloc((size_t)bytes)};
        if (w->packet == NULL) return 1;
        memcpy(w->packet, buffer, (size_t)bytes);
      }
    }
  }
  printf("{\"packets\": %llu, \"lost\": %llu, \"overflowed\": %llu, \"refused\": %llu}\n", took, lost, full, refused);
  return 0;
}
