#include "clients/bag/export.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "calib/model/rig_yaml.h"
#include "clients/bag/bag.h"
#include "clients/bag/picture_bag.h"
#include "clients/bag/static_tf.h"
#include "clients/bag/track_bag.h"
#include "clients/plot/track_file.h"

namespace huetrack::bag {
namespace {

void refuse_other_forms(const std::filesystem::path& out) {
  const std::string extension = out.extension();
  if (extension == ".db3" || extension == ".bag" || extension == ".csv")
    throw std::runtime_error(out.string() +
                             ": a rosbag2 is a folder, which gets its .db3 by itself (--out my_bag); "
                             "the other form is one file, --out FILE.mcap");
}

// A recording in place of the tracks: a common mistake.
void refuse_recording(const std::filesystem::path& tracks) {
  std::error_code none;
  if (std::filesystem::is_directory(tracks, none) || tracks.extension() == ".yaml")
    throw std::runtime_error(tracks.string() + ": is no track CSV; a recording's pictures are exported by --pictures " +
                             tracks.string());
}

using Tracks = std::map<std::string, std::vector<plot::TrackRow>>;

// The tracked cameras.
std::set<std::string> moving_of(const Tracks& tracks) {
  std::set<std::string> moving;
  for (const auto& [name, rows] : tracks)
    if (!rows.empty() && rows.front().is_camera) moving.insert(name);
  return moving;
}

}  // namespace

void export_track(const BagOptions& options) {
  refuse_other_forms(options.out);
  refuse_recording(options.tracks);
  if (options.tracks.empty() && options.pictures.empty())
    throw std::runtime_error("give a track CSV, or --pictures RECORDING, or both");
  const std::chrono::nanoseconds offset(std::llround(options.clock_offset_s * 1e9));
  Tracks tracks;
  if (!options.tracks.empty()) tracks = plot::read_tracks(options.tracks);
  const Bag bag = options.tracks.empty() ? Bag() : bag_of(tracks, options.frame_id, offset);
  std::vector<Topic> topics = bag.topics;
  std::optional<RecordedPictures> pictures;
  std::optional<Message> picture;
  if (!options.pictures.empty()) {
    pictures.emplace(options.pictures, options.rig, topics.size(), offset);
    topics.insert(topics.end(), pictures->topics().begin(), pictures->topics().end());
    picture = pictures->next();
    if (!picture && bag.messages.empty())
      throw std::runtime_error(options.pictures.string() + " has no picture: there is nothing to export");
  }
  const calib::CameraRig rig = pictures              ? pictures->rig()
                               : options.rig.empty() ? calib::CameraRig()
                                                     : calib::read_rig(options.rig);
  const bool has_places = !rig.cameras.empty();
  if (has_places) topics.push_back(static_tf_topic());

  std::error_code none;
  const bool was_there = std::filesystem::is_regular_file(options.out, none);  // a rosbag2 is always a new folder
  const auto writer =
      options.out.extension() == ".mcap" ? mcap_writer(topics, options.out) : rosbag2_writer(topics, options.out);
  std::size_t messages = 0;
  if (has_places) {  // first: valid for all that follow
    const std::int64_t from_ns = bag.messages.empty() ? picture->at_ns
                                 : picture            ? std::min(bag.messages.front().at_ns, picture->at_ns)
                                                      : bag.messages.front().at_ns;
    Message places = static_tf_of(rig, moving_of(tracks), options.frame_id, from_ns);
    places.topic = topics.size() - 1;
    writer->add(places);
    ++messages;
  }
  for (auto track = bag.messages.begin(); track != bag.messages.end() || picture; ++messages) {
    const bool is_tracks_turn = !picture || (track != bag.messages.end() && track->at_ns <= picture->at_ns);
    writer->add(is_tracks_turn ? *track : *picture);
    if (is_tracks_turn)
      ++track;
    else
      picture = pictures->next();
  }
  writer->finish();
  if (was_there) std::fprintf(stderr, "note: %s: the previous file is replaced\n", options.out.c_str());
  if (pictures)
    for (const std::string& warning : pictures->take_warnings()) std::fprintf(stderr, "note: %s\n", warning.c_str());
  if (pictures && options.clock_offset_s == 0 && pictures->started_at_s())
    std::fprintf(stderr, "note: times are of the recording's clock; --clock-offset %.9f makes them UNIX time\n",
                 *pictures->started_at_s());
  std::printf("%s: %zu messages on %zu topics:", options.out.c_str(), messages, topics.size());
  for (const Topic& topic : topics) std::printf(" %s", topic.name.c_str());
  std::printf("\n");
}

}  // namespace huetrack::bag
