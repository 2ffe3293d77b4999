#include "assertions.h"

#include <stdlib.h>
#include <unistd.h>

#include <filesystem>
#include <system_error>

HUETRACK_ASSERTIONS();

namespace {

// testing::TempDir() of each test program is a folder of its own, which ends with the program: ctest runs several tests
// of one program at once, and files of the same name would be one another's.
class OwnTempFolder {
 public:
  OwnTempFolder() {
    std::string folder = (std::filesystem::temp_directory_path() / "huetrack_XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(), "the tests' folder " + folder);
    std::filesystem::permissions(folder, std::filesystem::perms(0755));  // some tests act as another user
    setenv("TEST_TMPDIR", (folder + "/").c_str(), 1);
    folder_ = folder;
  }
  ~OwnTempFolder() {
    std::error_code ignored;  // what a test left without the right to remove it stays there
    if (getpid() == owner_) std::filesystem::remove_all(folder_, ignored);
  }

 private:
  std::filesystem::path folder_;
  pid_t owner_ = getpid();  // a forked child that exits is not the owner
};

const OwnTempFolder own_temp_folder;

}  // namespace
