// What a browser sends over a WebSocket. The first byte is how long the pieces are in which it comes: they change
// nothing.
#include <stdexcept>

#include "clients/live_view/web_sockets.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

namespace {

struct Taken {
  bool goes_on = true;
  std::string answer;
  bool operator==(const Taken&) const = default;
};

Taken take(std::string_view bytes, std::size_t piece) {
  live_view::WebSocketInput input;
  Taken taken;
  for (; taken.goes_on && !bytes.empty(); bytes.remove_prefix(std::min(piece, bytes.size())))
    taken.goes_on = input.take(bytes.substr(0, piece), taken.answer);
  return taken;
}

}  // namespace

HUETRACK_FUZZ_TARGET(web_socket) {
  if (input.empty()) return;
  const std::size_t piece = static_cast<unsigned char>(input.front()) + std::size_t{1};
  const std::string_view bytes = input.substr(1);
  if (take(bytes, piece) != take(bytes, bytes.size())) throw std::logic_error("other pieces, another answer");
  live_view::web_socket_accept(bytes);
}
