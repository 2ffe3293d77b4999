// `huetrack control WORDS...`: what a running service is asked in words (idl/README.md), and a recording fetched from
// it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "idl/dds_participant.h"

namespace huetrack::client {

struct ControlOptions {
  idl::ParticipantOptions participant;
  std::vector<std::string> words;  // "record download NAME" is fetched to a file; the rest is the service's
  std::string service;             // HOST/PID, where there are several; empty: the only one
  std::filesystem::path out;       // of a download; empty: NAME.tar here; "-": stdout
};

// Prints the answer: its rows on stdout, columns apart by tabs; its sentence on stderr. Returns 0, or 1: it is refused,
// or nobody answers. throws std::runtime_error of one readable line: the file is there already, or cannot be written.
int control(const ControlOptions& options);

}  // namespace huetrack::client
