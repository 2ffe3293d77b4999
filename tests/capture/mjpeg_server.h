// A camera of the network, served by the test itself: motion JPEG over HTTP, as thousands of cameras send it.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "capture/frames/file_descriptor.h"
#include "capture/frames/jpeg_encoder.h"
#include "capture/loopback_port.h"

namespace huetrack::capture {

inline std::vector<std::uint8_t> jpeg_picture(int width, int height, int grey) {
  WritableImage image = make_image(PixelFormat::i422, ColorRange::full, width, height);
  std::memset(image.data[0], grey, std::size_t(width) * std::size_t(height));
  for (const int chroma : {1, 2})
    std::memset(image.data[std::size_t(chroma)], 128, std::size_t(width) * std::size_t(height) / 2);
  return encode_picture(image.image, {.width = width, .height = height}, 90);
}

// Sends pictures 20 ms apart to whoever connects, and closes; again and again.
class MjpegServer {
 public:
  struct Film {
    int width = 64, height = 48, pictures = 10;
    bool is_silent_then = false;    // the connection stays open, and nothing comes
    std::string endless_then = {};  // the header of a picture, or of an answer, that never ends
    std::string type = "multipart/x-mixed-replace; boundary=frame";
    std::string first_boundary = "--frame\r\n",
                boundary = "--frame\r\n";  // before the first picture, before the others
    bool has_headers = true;               // of every picture: its type and length
    bool is_for_one = false;               // who connects once more is not served
    bool is_rtsp = false;                  // no pictures: `endless_then` answers DESCRIBE
  };
  explicit MjpegServer(Film film) : film_(film) {
    thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  }
  ~MjpegServer() {
    thread_.request_stop();
    ::shutdown(port_.listening.get(), SHUT_RDWR);
  }
  std::uint64_t sent() const { return sent_; }  // bytes of endless pictures
  std::string address() const {
    return std::string(film_.is_rtsp ? "rtsp" : "http") + "://user:secret@127.0.0.1:" + std::to_string(port_.number) +
           "/video.mjpg";
  }

 private:
  void serve(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const FileDescriptor client(::accept(port_.listening.get(), nullptr, nullptr));
      if (client.get() < 0) return;
      char request[2048];
      if (::recv(client.get(), request, sizeof request, 0) <= 0) continue;
      if (film_.is_rtsp) {
        send(client, "RTSP/1.0 200 OK\r\nCSeq: 1\r\nPublic: DESCRIBE\r\n\r\n");
        if (::recv(client.get(), request, sizeof request, 0) <= 0) continue;
        send_endless(client, stop);
        continue;
      }
      send(client, "HTTP/1.0 200 OK\r\nContent-Type: " + film_.type + "\r\n\r\n");
      for (int k = 0; k < film_.pictures && !stop.stop_requested(); ++k) {
        const auto jpeg = jpeg_picture(film_.width, film_.height, 40 + 10 * (k % 16));
        send(client, k == 0 ? film_.first_boundary : film_.boundary);
        if (film_.has_headers)
          send(client, "Content-Type: image/jpeg\r\nContent-Length: " + std::to_string(jpeg.size()) + "\r\n\r\n");
        send(client, std::string(jpeg.begin(), jpeg.end()) + "\r\n");
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      if (!film_.endless_then.empty()) send_endless(client, stop);
      if (film_.is_for_one) return;
      while (film_.is_silent_then && !stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void send_endless(const FileDescriptor& client, const std::stop_token& stop) {
    send(client, film_.endless_then);
    const std::string more(1 << 16, 'a');
    while (!stop.stop_requested() && send(client, more)) sent_ += more.size();
  }
  static bool send(const FileDescriptor& to, const std::string& bytes) {
    return ::send(to.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL) >= 0;
  }

  const Film film_;
  const LoopbackPort port_;
  std::atomic<std::uint64_t> sent_ = 0;
  std::jthread thread_;
};

}  // namespace huetrack::capture
