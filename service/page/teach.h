// `huetrackd teach`: a colour learnt from a recording or from the live cameras, in a terminal.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

namespace huetrack::page {

struct TeachCommand {
  std::filesystem::path config;
  std::vector<std::string> recording;  // as of replay; or the word live: the cameras of the configuration
  std::string target;                  // empty: the only one
  std::vector<std::string> at;         // CAMERA,FRAME,U,V; frames count from 0
  std::vector<std::string> ignore;     // CAMERA,U_MIN,V_MIN,U_MAX,V_MAX: added to those of the configuration
  bool accept = false;                 // where nobody pointed, take what is suggested
  bool radius = false;                 // take the radius that is told, though the configuration says another one
  bool only = false;                   // write it though a suggestion is neither confirmed nor taken
  bool dry_run = false;                // write nothing
  bool undo = false;                   // nothing is taught: what was saved last is undone
  bool redo = false;                   // nothing is taught: what was undone last is done again
  int wider = 0;
  std::filesystem::path pictures;  // folder for a picture of every view with the mask; empty: none
};

// Prints what was learnt; writes it into the configuration's taught file, and tells a service that runs with it on this
// host.
// Returns the exit status: 1 when nothing was learnt, or a suggestion is open: then nothing is written. throws
// ConfigError and other std::exceptions of one readable line.
int teach(const TeachCommand& command, std::stop_token stop);

}  // namespace huetrack::page
