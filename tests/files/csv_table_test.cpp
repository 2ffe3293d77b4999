#include "calib/files/csv_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "calib/files/config_error.h"

namespace huetrack::files {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

class Csv : public testing::Test {
 protected:
  ~Csv() override { fs::remove(file_); }
  CsvTable table(const std::string& text, std::vector<std::string_view> columns) {
    std::ofstream(file_) << text;
    return {file_, columns};
  }
  template <typename F>
  std::string error_of(F&& f) {
    try {
      f();
    } catch (const ConfigError& error) {
      return std::string(error.what()).substr(file_.string().size());
    }
    return "no error";
  }
  const fs::path file_ = fs::path(testing::TempDir()) /
                         (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".csv");
};

TEST_F(Csv, ColumnsAreFoundByTheirNames) {
  CsvTable t = table("b,other,a\n1,x,2\n\n3,y,nan\n", {"a", "b"});
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.number(0), 2);
  EXPECT_EQ(t.number(1), 1);
  EXPECT_EQ(t.line(), 2);
  ASSERT_TRUE(t.next());
  EXPECT_TRUE(std::isnan(t.number(0)));
  EXPECT_EQ(t.line(), 4);  // an empty line is a line, too
  EXPECT_FALSE(t.next());
}

TEST_F(Csv, ColumnsMayHaveAlternativeNamesAndBeOptional) {
  CsvTable t = table("ball,v\nlime,7\n", {"target|ball", "u|v?", "w?"});
  EXPECT_TRUE(t.has(1));
  EXPECT_FALSE(t.has(2));
  EXPECT_EQ(t.name(0), "ball");
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.text(0), "lime");
  EXPECT_EQ(t.number(1), 7);
  EXPECT_EQ(error_of([&] { table("a,b\n", {"target|ball"}); }), ":1: the header has no column target or ball");
}

TEST_F(Csv, IgnoresBlanksAndByteOrderMark) {
  CsvTable t = table("\xEF\xBB\xBFname, t\r\n left ,\t0.5\r\n\r\n", {"name", "t"});
  ASSERT_TRUE(t.next());
  EXPECT_EQ(t.text(0), "left");
  EXPECT_EQ(t.time(1).time_since_epoch(), 500ms);
  EXPECT_FALSE(t.next());
}

TEST_F(Csv, TimesAreExactToTheNanosecond) {
  CsvTable t = table("t\n1700000000.123456789\n-0.000000001\n3\n", {"t"});
  for (const auto expected : {1700000000123456789ns, -1ns, 3000000000ns}) {
    ASSERT_TRUE(t.next());
    EXPECT_EQ(t.time(0).time_since_epoch(), expected);
  }
}

TEST_F(Csv, SkipsATruncatedLastLineOnRequest) {
  CsvTable as_it_is = table("a,b\n1,2\n3,4", {"a"});
  EXPECT_TRUE(as_it_is.next() && as_it_is.next());
  EXPECT_FALSE(as_it_is.truncated_line().has_value());
  CsvTable whole = table("a,b\n1,2\n3", {"b"});
  whole.skip_truncated_row();
  EXPECT_TRUE(whole.next());
  EXPECT_FALSE(whole.next());
  EXPECT_EQ(whole.truncated_line(), 3);
}

TEST_F(Csv, ErrorsNameFileAndLine) {
  const auto first_number = [&](const std::string& text) {
    return error_of([&] {
      CsvTable t = table(text, {"a", "b"});
      while (t.next()) t.number(1);
    });
  };
  EXPECT_EQ(first_number(""), ": is empty: a header line is needed");
  EXPECT_EQ(first_number("a,c\n"), ":1: the header has no column b");
  EXPECT_EQ(first_number("a,b\n1,2\n1\n"), ":3: has 1 columns, at least 2 are needed");
  EXPECT_EQ(first_number("a,b\n1,two\n"), ":2: b must be a number, got \"two\"");
  EXPECT_EQ(error_of([&] {
              CsvTable t = table("t\n1e3\n", {"t"});
              t.next();
              t.time(0);
            }),
            ":2: t must be a time in seconds, got \"1e3\"");
  EXPECT_THROW(CsvTable("/no/such.csv", {}), ConfigError);
  EXPECT_THROW(CsvTable(testing::TempDir(), {}), ConfigError);
}

}  // namespace
}  // namespace huetrack::files
