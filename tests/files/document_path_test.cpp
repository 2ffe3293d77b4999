#include "calib/files/document_path.h"

#include <gtest/gtest.h>

#include <fstream>

#include "calib/files/temporary_folder.h"

namespace huetrack::files {
namespace {

namespace fs = std::filesystem;

TEST(DocumentPath, IsInstalledNextToProgram) {
  const TemporaryFolder prefix("document-path-test");
  const fs::path installed = prefix.path() / "share/doc/huetrack/calib/formats.md";
  EXPECT_EQ(document_path("calib/formats.md", prefix.path() / "bin"), "calib/formats.md");
  fs::create_directories(installed.parent_path());
  std::ofstream(installed) << "# Formats\n";
  EXPECT_EQ(document_path("calib/formats.md", prefix.path() / "bin"), installed);
  EXPECT_EQ(document_path("calib/none.md", prefix.path() / "bin"), "calib/none.md");
  EXPECT_EQ(document_path("calib/formats.md"), "calib/formats.md") << "this test is not installed";
}

}  // namespace
}  // namespace huetrack::files
