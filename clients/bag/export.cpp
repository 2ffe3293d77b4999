#include "clients/bag/export.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "clients/bag/bag.h"
#include "clients/bag/track_bag.h"
#include "clients/plot/track_file.h"

namespace huetrack::bag {

void export_track(const ExportOptions& options) {
  const std::string extension = options.out.extension();
  if (extension == ".db3" || extension == ".bag" || extension == ".csv")
    throw std::runtime_error(options.out.string() +
                             ": a rosbag2 is a folder, which gets its .db3 by itself (--out my_bag); "
                             "the other form is one file, --out FILE.mcap");
  const Bag bag = bag_of(plot::read_tracks(options.tracks), options.frame_id,
                         std::chrono::nanoseconds(std::llround(options.clock_offset_s * 1e9)));
  const bool is_mcap = extension == ".mcap";
  if (is_mcap)
    write_mcap(bag, options.out);
  else
    write_rosbag2(bag, options.out);
  std::printf("%s: %zu messages on %zu topics:", options.out.c_str(), bag.messages.size(), bag.topics.size());
  for (const Topic& topic : bag.topics) std::printf(" %s", topic.name.c_str());
  std::printf("\n");
}

}  // namespace huetrack::bag
