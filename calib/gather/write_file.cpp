#include "calib/gather/write_file.h"

#include <cerrno>
#include <fstream>
#include <system_error>

namespace huetrack::gather {

namespace fs = std::filesystem;

void write_file(const fs::path& file, const std::string& text) {
  const fs::path temporary = file.string() + ".new";
  errno = 0;
  {
    std::ofstream stream(temporary, std::ios::binary);
    stream << text;
    stream.flush();
    if (!stream)
      throw std::system_error(errno != 0 ? errno : EIO, std::generic_category(), "cannot write " + temporary.string());
  }
  fs::rename(temporary, file);
}

}  // namespace huetrack::gather
