// The first byte chooses the format and the file's extension.
#include <array>

#include "calib/exchange/exchange.h"
#include "calib/files/config_error.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(exchange) {
  if (input.empty()) return;
  using exchange::ExchangeFormat;
  constexpr std::array formats{ExchangeFormat::ros, ExchangeFormat::opencv, ExchangeFormat::kalibr,
                               ExchangeFormat::aniposelib, ExchangeFormat::caliscope};
  constexpr std::array extensions{".yaml", ".json", ".xml", ".toml"};
  const auto choice = static_cast<unsigned char>(input.front()) % (6 * extensions.size());
  exchange::ImportOptions options{.image_size = calib::ImageSize{640, 480}};
  if (const auto format = choice / extensions.size(); format < formats.size()) options.format = formats[format];
  const std::filesystem::path files[] = {
      fuzz::file_with(std::string("calibration") + extensions[choice % extensions.size()], input.substr(1))};
  try {
    const exchange::Imported imported = exchange::import_rig(files, options);
    for (const ExchangeFormat format : formats) exchange::export_rig(imported.rig, {.format = format});
  } catch (const files::ConfigError&) {
  } catch (const exchange::ExchangeError&) {
  }
}
