// The subcommands. Each returns its exit status: 0, or 1 after a message on stderr; `status` also unhealthy_status.
// SIGINT and SIGTERM end them.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "idl/dds_participant.h"
#include "sample_format.h"

namespace huetrack::client {

struct WatchOptions {
  idl::ParticipantOptions participant;
  Format format = Format::text;
  std::string target;                                    // empty: every target
  std::optional<std::string> camera;                     // poses of this camera instead ("all": of all)
  std::optional<std::uint64_t> count;                    // end after this many lines
  std::optional<std::chrono::duration<double>> timeout;  // end with 1 after this time without a line
  std::filesystem::path file;                            // empty: stdout
  bool overwrite = false;                                // an existing log
  std::string udp = {};                                  // HOST:PORT: each sample is a datagram, instead of stdout
};

void end_on_signals();  // call once, before the others
bool has_ended();       // by a signal

int watch(const WatchOptions& options);  // `watch`, and `log` with a file

enum class StatusFormat : std::uint8_t { text, json };  // json: a line per service, service_health.h
inline constexpr int unhealthy_status = 3;              // of a running service; 1: there is none
int status(const idl::ParticipantOptions& options, StatusFormat format);

// Shared: a message to stderr, and advice if no service is found.
void say(const std::string& sentence);
std::string what_to_check(const idl::DdsParticipant& participant);

}  // namespace huetrack::client
