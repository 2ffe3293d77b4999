// `huetrack control WORDS...`: requests to a running service (idl/README.md), and downloads from it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "idl/dds_participant.h"

namespace huetrack::client {

struct ControlOptions {
  idl::ParticipantOptions participant;
  std::vector<std::string> words;  // "record download NAME" writes a file; all others are sent as they are
  std::string service;             // HOST/PID if there are several; empty: the only one
  std::filesystem::path out;       // of a download; empty: NAME.tar here; "-": stdout
};

// Prints the reply: rows on stdout, separated by tabs; message on stderr. Returns 0, or 1: refused, or no reply. Throws
// std::runtime_error with a one-line message: the file exists or cannot be written.
int control(const ControlOptions& options);

}  // namespace huetrack::client
