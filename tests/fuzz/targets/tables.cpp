// The first byte chooses which reader of CSVs it is.
#include "calib/files/config_error.h"
#include "clients/plot/track_file.h"
#include "fuzz/fuzz_target.h"
#include "pipeline/recorded_changes.h"
#include "tracks/track_csv.h"
#include "truth/truth.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(tables) {
  if (input.empty()) return;
  try {
    const auto choice = static_cast<unsigned char>(input.front()) % 4;
    if (choice == 3) {
      fuzz::file_with("changes.csv", input.substr(1));
      pipeline::read_changes(fuzz::folder());
      return;
    }
    const auto file = fuzz::file_with("table.csv", input.substr(1));
    if (choice == 0) tracks::read_track_csv(file);
    if (choice == 1) truth::Truth::read(file);
    if (choice == 2) plot::read_tracks(file);
  } catch (const files::ConfigError&) {
  }
}
