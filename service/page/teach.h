// `huetrackd teach`: learns a colour from a recording or live cameras, in a terminal.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

namespace huetrack::page {

struct TeachCommand {
  std::filesystem::path config;
  std::vector<std::string> recording;  // as for replay; or the word live
  std::string target;                  // empty: the only one
  std::vector<std::string> at;         // CAMERA,FRAME,U,V; frames count from 0
  std::vector<std::string> ignore;     // CAMERA,U_MIN,V_MIN,U_MAX,V_MAX: added to those of the configuration
  bool accept = false;                 // accept suggestions in views without a point
  bool radius = false;                 // replace the configured radius by the measured one
  bool only = false;                   // save although suggestions are open
  bool force = false;                  // save although the object is not tracked with it; not what was accepted
  bool dry_run = false;                // save nothing
  bool undo = false;                   // only undo the last save
  bool redo = false;                   // only redo the last undone save
  int wider = 0;
  std::filesystem::path pictures;  // folder for a picture of every view with the mask; empty: none
};

// Prints what was learnt, saves it to the taught file, and makes a service with this configuration on this host reload
// it. Of the ranges' widths the one is saved with which the recording is tracked best. Returns the exit status: 1 if
// nothing was learnt, a suggestion is open or no width passes the trial; then nothing is saved. throws ConfigError and
// other std::exceptions with one readable line.
int teach(const TeachCommand& command, std::stop_token stop);

}  // namespace huetrack::page
