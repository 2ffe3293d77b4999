// A switch between the ends of veth pairs that takes its time and loses packets: the network between camera hosts and
// trackers, where the kernel has no netem. It learns who is where from the source addresses, as switches do.
//   slow_network [--no-multicast] [--slow INTERFACE,KBIT_PER_S,BYTES] DELAY_US LOST_PER_MILLION SEED INTERFACE...
// until a signal; then it prints how many packets it took and lost. Each packet waits DELAY_US on its way (a queue in
// order of arrival), then goes to the interface of its destination, or to all others. What is lost is drawn from SEED.
// --no-multicast: of IPv4 nothing goes to groups, as on many wireless and routed networks.
// --slow: from SIGUSR1 until SIGUSR2 what comes from that interface goes on at such a rate only: up to BYTES of it
// wait, and a packet that finds no room is lost. As root.
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
struct queue {
  struct waiting waiting[most_waiting];
  unsigned first, next;
};
static struct queue usual, slow;  // each in order of its packets' times

static struct {
  const char* interface;
  double ns_per_byte;
  int64_t room_ns;  // what all of its bytes take
  int64_t free_ns;  // when all that waits is gone
} limit;
static volatile sig_atomic_t is_slow;
static void on_slow(int signal) {
  is_slow = signal == SIGUSR1;
}

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

static void forward_due(struct queue* q, const struct pollfd* ports, int count, unsigned long long* refused) {
  const int64_t now = now_ns();
  while (q->first != q->next && q->waiting[q->first % most_waiting].due_ns <= now) {
    struct waiting* const w = &q->waiting[q->first++ % most_waiting];
    const uint8_t* const to = w->packet + header_bytes;
    const int port = (to[0] & 1) ? -1 : port_of(to);
    for (int p = 0; p < count; ++p)
      if (p != w->from && (port < 0 || p == port) && send(ports[p].fd, w->packet, (size_t)w->bytes, 0) < 0) ++*refused;
    free(w->packet);
  }
}

static int64_t until_due_ns(const struct queue* q) {
  return q->first == q->next ? 100000000 : q->waiting[q->first % most_waiting].due_ns - now_ns();
}

// When a packet that comes now has passed the slow link; -1: it finds no room.
static int64_t passed_ns(int64_t came_ns, int64_t bytes) {
  if (limit.free_ns < came_ns) limit.free_ns = came_ns;
  const int64_t takes_ns = (int64_t)(limit.ns_per_byte * (double)bytes);
  if (limit.free_ns + takes_ns - came_ns > limit.room_ns) return -1;
  return limit.free_ns += takes_ns;
}

int main(int argc, char** argv) {
  const int no_multicast = argc > 1 && strcmp(argv[1], "--no-multicast") == 0;
  argc -= no_multicast, argv += no_multicast;
  if (argc > 2 && strcmp(argv[1], "--slow") == 0) {
    limit.interface = strtok(argv[2], ",");
    const char *const rate = strtok(NULL, ","), *const bytes = strtok(NULL, ",");
    if (rate == NULL || bytes == NULL) return 2;
    limit.ns_per_byte = 8e6 / atof(rate);
    limit.room_ns = (int64_t)(limit.ns_per_byte * atof(bytes));
    argc -= 2, argv += 2;
  }
  if (argc < 6 || argc - 4 > most_ports) {
    fprintf(stderr,
            "slow_network [--no-multicast] [--slow INTERFACE,KBIT_PER_S,BYTES] DELAY_US LOST_PER_MILLION SEED "
            "INTERFACE INTERFACE...\n");
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
  signal(SIGUSR1, on_slow);
  signal(SIGUSR2, on_slow);
  prctl(PR_SET_TIMERSLACK, 1000UL);
  uint8_t buffer[most_bytes];
  unsigned long long took = 0, lost = 0, full = 0, refused = 0;
  while (!ended) {
    forward_due(&usual, polled, ports, &refused);
    forward_due(&slow, polled, ports, &refused);
    const int64_t usual_ns = until_due_ns(&usual), slow_ns = until_due_ns(&slow);
    const int64_t wait_ns = usual_ns < slow_ns ? usual_ns : slow_ns;
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
        const int takes_slow_link = is_slow && limit.interface != NULL && strcmp(argv[4 + p], limit.interface) == 0;
        const int64_t on_ns = takes_slow_link ? passed_ns(came_ns, bytes) : came_ns;
        struct queue* const q = takes_slow_link ? &slow : &usual;
        if (on_ns < 0 || q->next - q->first == most_waiting) {
          ++full;
          continue;
        }
        struct waiting* const w = &q->waiting[q->next++ % most_waiting];
        *w = (struct waiting){
            .due_ns = on_ns + delay_ns, .from = p, .bytes = (int)bytes, .packet = malloc((size_t)bytes)};
        if (w->packet == NULL) return 1;
        memcpy(w->packet, buffer, (size_t)bytes);
      }
    }
  }
  printf("{\"packets\": %llu, \"lost\": %llu, \"overflowed\": %llu, \"refused\": %llu}\n", took, lost, full, refused);
  return 0;
}
