// `huetrackd doctor [CONFIG]`: examines host, cameras and configuration. Every finding has a grade and advice.
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
  note,     // information
  warning,  // reduces quality
  problem,  // does not work
};

struct Finding {
  Grade verdict = Grade::ok;
  std::string what;
  std::string advice;  // what to do; empty: nothing
};

struct DoctorOptions {
  std::optional<std::filesystem::path> config;  // nullopt: only the host and its cameras
  double seconds = 3;                           // > 0; duration of the stream
  bool streams = true;                          // false: do not stream
};

// Prints findings to stdout. Returns the number of problems. No exceptions: errors are findings.
int doctor(const DoctorOptions& options, const std::stop_token& stop);

// ---- Judgement: pure functions

// is_expected: the camera is in the configuration, or there is none.
std::vector<Finding> judge_camera(const CameraExam& exam, bool is_expected);

// Data rate of the streaming cameras per USB bus, against its limit. bus_mbps: of each root hub.
std::vector<Finding> judge_usb(std::span<const CameraExam> exams, const std::map<int, double>& bus_mbps);

// interfaces: "eth0 192.168.0.5", those that DDS would use. are_chosen: set by dds.interfaces.
std::vector<Finding> judge_network(int domain, const std::string& domain_from,
                                   const std::vector<std::string>& interfaces, bool are_chosen);

// A remote camera.
struct SentCamera {
  std::string name;
  int width = 0, height = 0;
  double fps = 30;
  std::optional<capture::CaptureFormat> format;  // nullopt: unknown, assumed mjpeg
};
// Network load between a camera host and its trackers. receive_buffer: net.core.rmem_max, bytes; nullopt: unknown.
std::vector<Finding> judge_sending(std::span<const SentCamera> cameras, std::optional<double> receive_buffer,
                                   bool is_tracker);
std::vector<Finding> judge_hosted(const HostedExam& exam);
Finding judge_clock(const capture::HostClock& clock);
// kept_s: hosts::MachineClock::kept_s.
std::vector<Finding> judge_clock(const std::optional<double>& kept_s);

// For the last line: "; 2 of 3 cameras could not be examined: busy", or empty.
std::string not_examined(int busy, int cameras);

std::string to_text(const Finding& finding);  // "  ok    ...\n", or "  FAIL  ...\n        -> ...\n"

}  // namespace huetrack::doctor
