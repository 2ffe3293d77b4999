// The subcommands. Each returns the exit status: 0, or 1 after it has said why on stderr; status besides
// unhealthy_status. SIGINT and SIGTERM end them.
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
  std::optional<std::string> camera;                     // poses of this camera instead ("all": of every one)
  std::optional<std::uint64_t> count;                    // end after so many lines
  std::optional<std::chrono::duration<double>> timeout;  // end with 1 when no line came for so long
  std::filesystem::path file;                            // empty: stdout
  bool overwrite = false;                                // an existing file
  std::string udp = {};                                  // HOST:PORT: each sample is a datagram, instead of stdout
};

void end_on_signals();  // call once, before the others
bool has_ended();       // a signal came

int watch(const WatchOptions& options);  // `watch`, and `log` with a file

enum class StatusFormat : std::uint8_t { text, json };  // json: a line per service, service_health.h
inline constexpr int unhealthy_status = 3;              // of a service that is there; 1: none is
int status(const idl::ParticipantOptions& options, StatusFormat format);

// What they share: a sentence to stderr, and where to look when nobody is heard.
void say(const std::string& sentence);
std::string what_to_check(const idl::DdsParticipant& participant);

}  // namespace huetrack::client
