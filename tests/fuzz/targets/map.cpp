// A camera's map. Its check sum is made right: it is no secret, and without it nothing would be read.
#include <cstring>
#include <stdexcept>

#include "camera_tracking/scene_map.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(map) {
  std::string bytes(input);
  constexpr std::size_t magic = 22, head = magic + 8;
  if (bytes.size() > head) {
    std::uint64_t sum = 0xcbf29ce484222325u;  // FNV-1a
    for (std::size_t i = head; i < bytes.size(); ++i)
      sum = (sum ^ static_cast<unsigned char>(bytes[i])) * 0x100000001b3u;
    std::memcpy(bytes.data() + magic, &sum, sizeof sum);
  }
  try {
    camera_tracking::read_map(fuzz::file_with("camera.map", bytes));
  } catch (const std::runtime_error&) {
  }
}
