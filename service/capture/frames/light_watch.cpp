#include "capture/frames/light_watch.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

namespace huetrack::capture {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr double two_pi = 2 * std::numbers::pi;

constexpr double longest_gap_s = 2;  // a window ends at a longer one
// Gaps between samples, relative to their mean. Of 60000 random sequences the one with the least aliasing: a frequency
// has at most 7.6 % of its power 2 Hz or more away, where even gaps have all of it.
constexpr std::array<double, LightWatch::samples - 1> uneven_gaps{
    1.25, 0.75, 0.25, 1.75, 0.25, 1.75, 1.75, 1.5, 1.0,  1.25, 0.75, 0.5, 0.25, 1.75, 0.5, 0.25,
    1.25, 1.25, 1.75, 1.5,  0.25, 0.75, 0.5,  1.0, 0.75, 1.0,  1.5,  1.5, 0.5,  0.5,  1.0};

constexpr float darkest = 0.06f, brightest = 0.92f;  // of 0..1: in between, a change of light is a factor
constexpr std::size_t least_cells_of_row = 5, least_cells_of_strip = 20;
// Median deviation of the cells from their row's change: noise, 0.01 to 0.03, in a still picture; more while the camera
// moves.
constexpr double unsteady_deviation = 0.08;
constexpr std::size_t most_unsteady = LightWatch::samples / 5;

// Flicker. Bands over the image's height: of readouts from 7 to 45 ms.
constexpr double fewest_bands = 0.75, most_bands = 5, step_of_bands = 0.25;
constexpr auto band_count = std::size_t((most_bands - fewest_bands) / step_of_bands + 1.5);
constexpr double lowest_hz = 96, highest_hz = 124, step_hz = 0.2;  // 1 / window is 0.24 Hz
constexpr double of_mains_hz = 0.4;                                // mains are accurate to 0.2 %, and so are clocks
constexpr double standing_hz = 0.4;         // slower bands cannot be distinguished from a lamp that was moved
constexpr double apart_hz = 2;              // of other frequencies from that of the flicker
constexpr double least_modulation = 0.005;  // a hundredth of the light: harmless for a colour's range
constexpr double least_explained = 0.25;    // share of all that changes between rows
constexpr double above_others = 3;          // in power

// A slow change of all of the picture, in logarithms: 0.025 is 6 % of the light.
constexpr double least_drift = 0.025;
constexpr std::size_t least_strips = 6;
constexpr double largest_disagreement = 0.3;  // of a strip, share of the change
constexpr int most_strips_apart = 3;
constexpr std::size_t most_disagreeing = LightWatch::samples / 4;  // samples with more disagreeing strips
constexpr double largest_step = 0.75;  // share of the change within the smoothing: more is a light switch
constexpr std::size_t smoothing = 5;   // samples: takes the flicker out
constexpr int windows_until_gone = 6;

double median(std::span<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

struct Values {
  double r, g, b;  // as in the picture, 0..1, not clamped
};
Values values_at(const Image& image, int u, int v) {
  if (image.format == PixelFormat::bgr) {
    const Bgr p = bgr_at(image, u, v);
    return {p.r / 255.0, p.g / 255.0, p.b / 255.0};
  }
  const Yuv p = yuv_at(image, u, v);
  const bool is_limited = image.range == ColorRange::limited;
  const double y = is_limited ? (p.y - 16) / 219.0 : p.y / 255.0, scale = is_limited ? 1 / 224.0 : 1 / 255.0;
  const double cb = (p.u - 128) * scale, cr = (p.v - 128) * scale;
  return {y + 1.402 * cr, y - 0.344 * cb - 0.714 * cr, y + 1.772 * cb};
}

float logarithm(double value) {
  const auto v = static_cast<float>(value);
  return v >= darkest && v <= brightest ? std::log(v) : nan;
}

}  // namespace

bool LightFindings::operator==(const LightFindings& other) const {
  return flicker.has_value() == other.flicker.has_value() &&
         (!flicker || flicker->light_hz == other.flicker->light_hz) &&
         exposure_change.has_value() == other.exposure_change.has_value() &&
         balance_change.has_value() == other.balance_change.has_value();
}

LightWatch::LightWatch(double window_s) : mean_gap_s_(window_s / double(samples)) {
  scratch_.reserve(rows * columns);
}

bool LightWatch::is_wanted(Timestamp at) {
  const double period_s = seconds(at - std::exchange(last_frame_, at));
  if (count_ == 0 || period_s <= 0 || period_s > longest_gap_s) {
    count_ = 0;
    return true;
  }
  if (period_count_ < periods_.size()) periods_[period_count_++] = period_s;
  if (--frames_until_wanted_ > 0) return false;
  const double gap = uneven_gaps[count_ % uneven_gaps.size()] * mean_gap_s_ / period_s;
  frames_until_wanted_ = int(std::clamp(std::round(gap), 1.0, 1000.0));
  return true;
}

bool LightWatch::look(const Image& whole, Timestamp at) {
  // Of a compressed image the means of 8x8 pixels, which cost no decoding and have less noise.
  const Image eighth = whole.on_demand ? whole.on_demand->eighth() : Image{};
  const bool is_enough = eighth.width >= 2 * int(columns) && eighth.height >= int(rows);
  const Image& image = is_enough ? eighth : whole;
  if (image.width < 2 * int(columns) || image.height < int(rows)) return false;
  if (count_ == 0) {
    begin(image, at);
    return false;
  }
  time_s_[count_] = seconds(at - began_);
  if (!add(image)) {
    begin(image, at);
    return false;
  }
  if (++count_ < samples) return false;
  const LightFindings found = judge_window();
  ++windows_;
  begin(image, at);
  const LightFindings before = findings_;
  const auto take = [](auto& known, const auto& fresh, int& without) {
    if (fresh) {
      known = fresh;
      without = 0;
    } else if (++without >= windows_until_gone) {
      known.reset();
    }
  };
  take(findings_.flicker, found.flicker, windows_without_[0]);
  take(findings_.exposure_change, found.exposure_change, windows_without_[1]);
  take(findings_.balance_change, found.balance_change, windows_without_[2]);
  return !(findings_ == before);
}

void LightWatch::read(const Image& image, Cells& cells) {
  constexpr int pixels = 4;  // of a cell, in one row
  for (int i = 0; i < int(rows); ++i) {
    const int v = (2 * i + 1) * image.height / (2 * int(rows));
    for (int j = 0; j < int(columns); ++j) {
      Values sum{0, 0, 0};
      for (int k = 0; k < pixels; ++k) {
        const int u = (2 * (j * pixels + k) + 1) * image.width / (2 * int(columns) * pixels);
        const Values p = values_at(image, u, v);
        sum.r += p.r, sum.g += p.g, sum.b += p.b;
      }
      cells[std::size_t(i) * columns + std::size_t(j)] = {logarithm(sum.r / pixels), logarithm(sum.g / pixels),
                                                          logarithm(sum.b / pixels)};
    }
  }
}

void LightWatch::begin(const Image& image, Timestamp at) {
  read(image, first_);
  began_ = at;
  unsteady_ = period_count_ = 0;
  time_s_[0] = 0;
  row_change_[0].fill(0);
  for (Change* change : {&exposure_, &red_, &blue_})
    for (Series& series : change->of_strip) series[0] = 0;
  count_ = 1;
}

bool LightWatch::add(const Image& image) {
  read(image, now_);
  // Rows: of green, which is most of the luma and where a camera has most pixels.
  std::array<double, columns> changes{};
  std::vector<double>& deviations = scratch_;
  deviations.clear();
  for (std::size_t i = 0; i < rows; ++i) {
    std::size_t n = 0;
    for (std::size_t c = i * columns; c < (i + 1) * columns; ++c) {
      const double change = double(now_[c].g) - double(first_[c].g);
      if (!std::isnan(change)) changes[n++] = change;
    }
    double& row = row_change_[count_][i];
    row = n < least_cells_of_row ? std::numeric_limits<double>::quiet_NaN() : median(std::span(changes).first(n));
    for (std::size_t k = 0; k < n && !std::isnan(row); ++k) deviations.push_back(std::abs(changes[k] - row));
  }
  if (deviations.size() < rows * columns / 4) return false;  // nearly all black or white
  if (median(deviations) > unsteady_deviation && ++unsteady_ > most_unsteady) return false;

  for (std::size_t s = 0; s < strips; ++s) {
    const auto change_of = [&](auto&& value) {
      scratch_.clear();
      for (std::size_t i = 0; i < rows; ++i) {
        for (std::size_t j = s * columns / strips; j < (s + 1) * columns / strips; ++j) {
          const std::size_t c = i * columns + j;
          const double change = value(now_[c]) - value(first_[c]);
          if (!std::isnan(change)) scratch_.push_back(change);
        }
      }
      return scratch_.size() < least_cells_of_strip ? std::numeric_limits<double>::quiet_NaN() : median(scratch_);
    };
    exposure_.of_strip[s][count_] = change_of([](const Cell& cell) { return double(cell.g); });
    red_.of_strip[s][count_] = change_of([](const Cell& cell) { return double(cell.r) - double(cell.g); });
    blue_.of_strip[s][count_] = change_of([](const Cell& cell) { return double(cell.b) - double(cell.g); });
  }
  return true;
}

LightFindings LightWatch::judge_window() {
  LightFindings found;
  found.flicker = find_flicker();
  found.exposure_change = find_drift(exposure_, count_);
  const auto red = find_drift(red_, count_), blue = find_drift(blue_, count_);
  if (red || blue) found.balance_change = std::max(red.value_or(0), blue.value_or(0));
  return found;
}

// An object in front of a strip spoils that strip only: the change of the whole picture is the median of the strips,
// with which most of them must agree.
std::optional<double> LightWatch::find_drift(const Change& change, std::size_t count) {
  Series all{}, smooth{};
  for (std::size_t t = 0; t < count; ++t) {
    std::array<double, strips> values{};
    std::size_t used = 0;
    for (const Series& strip : change.of_strip)
      if (!std::isnan(strip[t])) values[used++] = strip[t];  // else it is black or white
    if (used < least_strips) return std::nullopt;
    all[t] = median(std::span(values).first(used));
  }
  const std::size_t n = count - smoothing + 1;
  for (std::size_t t = 0; t < n; ++t)
    for (std::size_t k = 0; k < smoothing; ++k) smooth[t] += all[t + k] / double(smoothing);
  const auto [low, high] = std::minmax_element(smooth.begin(), smooth.begin() + std::ptrdiff_t(n));
  const double drift = *high - *low;
  if (drift < least_drift) return std::nullopt;
  std::size_t disagreeing = 0;
  for (std::size_t t = 0; t < count; ++t) {
    const auto others = std::ranges::count_if(change.of_strip, [&](const Series& strip) {
      return !(std::abs(strip[t] - all[t]) <= largest_disagreement * drift);
    });
    disagreeing += others > most_strips_apart ? 1 : 0;
  }
  if (disagreeing > most_disagreeing) return std::nullopt;
  // A switched light appears as a straight line of the smoothing's length.
  for (std::size_t t = smoothing; t < n; ++t)
    if (std::abs(smooth[t] - smooth[t - smoothing]) > largest_step * drift) return std::nullopt;
  return std::exp(drift) - 1;
}

// Subtracts each row's mean over the window and each frame's mean over the rows.
std::optional<LightWatch::Ripple> LightWatch::find_ripple() {
  std::array<double, rows> mean{};
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t t = 0; t < count_; ++t) mean[i] += row_change_[t][i] / double(count_);
  }
  Ripple ripple;
  for (std::size_t i = 0; i < rows; ++i) ripple.used_rows += std::isnan(mean[i]) ? 0 : 1;
  if (ripple.used_rows < rows / 2) return std::nullopt;
  for (std::size_t t = 0; t < count_; ++t) {
    double of_frame = 0;
    for (std::size_t i = 0; i < rows; ++i) {
      double& value = row_change_[t][i];
      value = std::isnan(mean[i]) ? 0 : value - mean[i];
      of_frame += value / double(ripple.used_rows);
    }
    for (std::size_t i = 0; i < rows; ++i) {
      if (!std::isnan(mean[i])) row_change_[t][i] -= of_frame;
      ripple.power += row_change_[t][i] * row_change_[t][i];
    }
  }
  ripple.power /= double(count_ * ripple.used_rows);
  if (ripple.power <= 0 || period_count_ == 0) return std::nullopt;
  ripple.frames_hz = 1 / median(std::span(periods_).first(period_count_));
  return ripple;
}

using Complex = std::complex<double>;
// Of bands over the image's height, per k and sample.
struct LightWatch::Amplitudes : std::array<std::array<Complex, samples>, band_count> {};

struct LightWatch::Peak {
  double hz = 0, seen_hz = 0, bands = 0, modulation = 0;
};

LightWatch::Amplitudes LightWatch::band_amplitudes(std::size_t used_rows) const {
  Amplitudes amplitude{};
  for (std::size_t k = 0; k < band_count; ++k) {
    const double bands = fewest_bands + step_of_bands * double(k);
    for (std::size_t i = 0; i < rows; ++i) {
      const Complex wave = std::polar(1.0 / double(used_rows), -two_pi * bands * (double(i) + 0.5) / double(rows));
      for (std::size_t t = 0; t < count_; ++t) amplitude[k][t] += wave * row_change_[t][i];
    }
  }
  return amplitude;
}

// At one frequency: the best k for sensors that read downwards, and upwards.
std::array<LightWatch::Peak, 2> LightWatch::peaks_at(double hz, double frames_hz, const Amplitudes& amplitude) const {
  std::array<Peak, 2> peaks{};
  // The bands' apparent frequency, aliased by the frame rate: 0 .. frames_hz.
  const auto seen_hz = [&](bool is_upward) {
    const double turned = std::fmod(is_upward ? -hz : hz, frames_hz);
    return turned < 0 ? turned + frames_hz : turned;
  };
  for (const bool is_upward : {false, true}) {
    peaks[is_upward ? 1 : 0].hz = hz;
    peaks[is_upward ? 1 : 0].seen_hz = seen_hz(is_upward);
  }
  std::array<Complex, samples> turn{};
  for (std::size_t t = 0; t < count_; ++t) turn[t] = std::polar(2.0 / double(count_), -two_pi * hz * time_s_[t]);
  for (std::size_t k = 0; k < band_count; ++k) {
    // turn * amplitude, and turn * conj(amplitude) for sensors that read upwards.
    double rr = 0, ii = 0, ri = 0, ir = 0;
    for (std::size_t t = 0; t < count_; ++t) {
      const Complex &w = turn[t], &a = amplitude[k][t];
      rr += w.real() * a.real(), ii += w.imag() * a.imag(), ri += w.real() * a.imag(), ir += w.imag() * a.real();
    }
    const std::array<double, 2> modulation{std::hypot(rr - ii, ri + ir), std::hypot(rr + ii, ir - ri)};
    for (const std::size_t way : {0u, 1u}) {
      if (modulation[way] <= peaks[way].modulation) continue;
      peaks[way].modulation = modulation[way];
      peaks[way].bands = fewest_bands + step_of_bands * double(k);
    }
  }
  return peaks;
}

std::optional<Flicker> LightWatch::find_flicker() {
  const std::optional<Ripple> ripple = find_ripple();
  if (!ripple) return std::nullopt;
  const Amplitudes amplitude = band_amplitudes(ripple->used_rows);
  const auto apart = [&](double a, double b) { return std::abs(std::remainder(a - b, ripple->frames_hz)); };
  constexpr auto hz_count = std::size_t((highest_hz - lowest_hz) / step_hz + 1.5);
  std::array<std::array<Peak, 2>, hz_count> peaks{};
  Peak best;
  for (std::size_t f = 0; f < hz_count; ++f) {
    const double hz = lowest_hz + step_hz * double(f);
    peaks[f] = peaks_at(hz, ripple->frames_hz, amplitude);
    const bool is_of_mains = std::min(std::abs(hz - 100), std::abs(hz - 120)) <= of_mains_hz + 1e-9;
    for (const Peak& peak : peaks[f])
      if (is_of_mains && apart(peak.seen_hz, 0) > standing_hz && peak.modulation > best.modulation) best = peak;
  }
  if (best.modulation < least_modulation || best.modulation * best.modulation / 2 < least_explained * ripple->power)
    return std::nullopt;
  for (const auto& both : peaks) {
    for (const Peak& other : both) {
      if (apart(other.seen_hz, best.seen_hz) < apart_hz) continue;
      if (above_others * other.modulation * other.modulation > best.modulation * best.modulation) return std::nullopt;
    }
  }
  return Flicker{best.hz < 110 ? 100.0 : 120.0, best.modulation, best.bands};
}

}  // namespace huetrack::capture
