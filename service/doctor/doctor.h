// `huetrackd doctor [CONFIG]`: what is wrong before it hurts. Every line has a verdict, and what to do about it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "doctor/camera_exam.h"
#include "doctor/hosted_exam.h"

namespace huetrack::doctor {

enum class Grade : std::uint8_t {
  ok,
  note,     // good to know
  warning,  // tracking suffers, or will
  problem,  // it does not work so
};

struct Finding {
  Grade verdict = Grade::ok;
  std::string what;
  std::string advice;  // what to do; empty where nothing is to be done
};

struct DoctorOptions {
  std::optional<std::filesystem::path> config;  // nullopt: the host and its cameras only
  double seconds = 3;                           // > 0; how long the cameras stream
  bool streams = true;                          // false: cameras are looked at, not streamed from
};

// Prints its findings to stdout as it goes. The number of problems. No exception: what goes wrong is a finding.
int doctor(const DoctorOptions& options, const std::stop_token& stop);

// ---- What it judges by, pure

// is_expected: the configuration names this camera, or there is none.
std::vector<Finding> judge_camera(const CameraExam& exam, bool is_expected);

// The cameras that stream, per USB bus, against what such a bus may give to cameras. bus_mbps: of each bus's root hub.
std::vector<Finding> judge_usb(std::span<const CameraExam> exams, const std::map<int, double>& bus_mbps);

// interfaces: "eth0 192.168.0.5", as the bus would be joined. are_chosen: the configuration says which
// (dds.interfaces).
std::vector<Finding> judge_network(int domain, const std::string& domain_from,
                                   const std::vector<std::string>& interfaces, bool are_chosen);

// A camera whose frames travel between hosts.
struct SentCamera {
  std::string name;
  int width = 0, height = 0;
  double fps = 30;
  std::optional<capture::CaptureFormat> format;  // nullopt: not known here, taken for mjpeg
};
// Between a camera host and its trackers, as seen from one of them. receive_buffer: what a socket of a tracker may ask
// for, bytes (net.core.rmem_max); nullopt: not known.
std::vector<Finding> judge_sending(std::span<const SentCamera> cameras, std::optional<double> receive_buffer,
                                   bool is_tracker);
// A camera of another host.
std::vector<Finding> judge_hosted(const HostedExam& exam);
// How the clock of such a host compares with ours.
Finding judge_clock(const capture::HostClock& clock);
// kept_s: hosts::MachineClock::kept_s.
std::vector<Finding> judge_clock(const std::optional<double>& kept_s);

// For the last line: "; 2 of 3 cameras could not be examined: busy", or empty.
std::string not_examined(int busy, int cameras);

std::string to_text(const Finding& finding);  // "  ok    ...\n", or "  FAIL  ...\n        -> ...\n"

}  // namespace huetrack::doctor
