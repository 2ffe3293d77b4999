#include "calib/files/csv_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "calib/files/config_error.h"
#include "calib/files/number_text.h"

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
  EXPECT_EQ(error_of([&] { table("a,b\n", {"target|ball"}); }),
            ":1: the header has no column target or ball: it has a, b");
}

// As pandas writes a table with its index.
TEST_F(Csv, NamesMayBeInCapitals) {
  CsvTable t = table(",Time,X,Y,y\n7,0.5,1,2,3\n", {"ball|target?", "t|@time", "x", "y"});
  ASSERT_TRUE(t.next());
  EXPECT_FALSE(t.has(0));
  EXPECT_EQ(t.time(1).time_since_epoch(), 500ms);
  EXPECT_EQ(t.number(2), 1);
  EXPECT_EQ(t.number(3), 3) << "the name that is spelt alike comes first";
  EXPECT_EQ(t.name(2), "X");
}

// Comments before the header, and the header as a comment, which numpy writes.
TEST_F(Csv, CommentsMayComeBeforeTheHeader) {
  for (const std::string text :
       {"# by a logger, version 2\n#\nframe,t_s\n+3,+0.5\n", "# by a logger\n# frame,t_s\n3,0.5\n",
        "# frame t_s\n3 0.5\n", "frame,t_s\n,\n3,0.5\n,\n"}) {
    CsvTable t = table(text, {"frame", "t_s"});
    ASSERT_TRUE(t.next()) << text;
    EXPECT_EQ(t.whole_number(0), 3);
    EXPECT_EQ(t.time(1).time_since_epoch(), 500ms);
    EXPECT_FALSE(t.next());
  }
  EXPECT_EQ(error_of([&] {
              table("# frame,when\n3,0.5\n", {"frame", "t_s"});
            }),
            ":2: has no header line; that of the comment lacks columns: it has frame, when");
  EXPECT_THAT(error_of([&] {
                table("# timestamp format v2\n0.000\n", {"frame", "t_s"});
              }),
              testing::HasSubstr("mkvmerge's list of time stamps: write the header frame,t_ms"));
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

TEST_F(Csv, TimesMayHaveAnExponentAndAUnit) {
  struct Case {
    std::string name, value;
    std::chrono::nanoseconds expected;
  };
  for (const Case& c : {Case{"t", "2.003333299999999895e+01", 20033333000ns},
                        {"t_s", "1e3", 1000s},
                        {"time_ms", "33.333", 33333us},
                        {"t_us", "5", 5us},
                        {"Timestamp [ns]", "1700000000123456789", 1700000000123456789ns},
                        {"t (ms)", "1700000000123.5", 1700000000123500us},
                        {"timestamp", "-1.5e-9", -2ns}}) {
    CsvTable t = table("x," + c.name + "\n0," + c.value, {"t|@time"});
    ASSERT_TRUE(t.next());
    EXPECT_EQ(t.time(0).time_since_epoch(), c.expected) << c.name;
  }
  EXPECT_EQ(error_of([&] { table("a,t_min\n", {"t|@time"}); }), ":1: the header has no column t: it has a, t_min");
  EXPECT_EQ(
      error_of([&] {
        CsvTable t = table("t_s\n1700000000123\n", {"t_s|@time"});
        t.next();
        t.time(0);
      }),
      ":2: t_s must be a time in seconds, got \"1700000000123\": if these are milliseconds, name the column t_ms");
}

TEST_F(Csv, ReadsWhatSpreadsheetsAndNumpyWrite) {
  for (const std::string text : {"frame;t;x\n3;0,25;-1,5e2\n", "sep=;\r\nframe;t;x\r\n3;0,25;-1,5e2\r\n",
                                 "\xEF\xBB\xBFsep=;\nframe;t;x\n3;0,25;-1,5e2", "frame\tt\tx\n3\t0,25\t-150\n",
                                 "# frame t x\n3.000e+00 2.5e-01  -1.5e+02\n", "# frame,t,x\n3.0,0.25,-150\n",
                                 "\"frame\";\"t\";\"x\"\n\"3\";\"0,25\";\"-150\"\n"}) {
    CsvTable t = table(text, {"frame", "t", "x"});
    ASSERT_TRUE(t.next()) << text;
    EXPECT_EQ(t.whole_number(0), 3) << text;
    EXPECT_EQ(t.time(1).time_since_epoch(), 250ms) << text;
    EXPECT_EQ(t.number(2), -150) << text;
    EXPECT_FALSE(t.next()) << text;
  }
  CsvTable commas = table("a,b,c\n0,5,1,5,x\n", {"c"});  // with decimal commas as well: not guessed
  ASSERT_TRUE(commas.next());
  EXPECT_EQ(error_of([&] {
              table(std::string("\xFF\xFE"
                                "a\0;\0",
                                6),
                    {"a"});
            }),
            ":1: is UTF-16: save it as CSV in UTF-8");
}

// Spreadsheets of countries with decimal commas, and pandas' to_csv(decimal=",").
TEST_F(Csv, DecimalCommasBetweenCommasAreInQuotesOrNamed) {
  CsvTable quoted = table("frame,t,x\n3,\"0,25\",\"a \"\"b\"\", c\"\n", {"frame", "t", "x"});
  ASSERT_TRUE(quoted.next());
  EXPECT_EQ(quoted.time(1).time_since_epoch(), 250ms);
  EXPECT_EQ(quoted.text(2), "a \"\"b\"\", c");
  EXPECT_FALSE(quoted.next());
  CsvTable open_quotes = table("a,b\n1,\"2\n", {"a"});
  EXPECT_TRUE(open_quotes.next());
  EXPECT_THAT(error_of([&] {
                CsvTable t = table("frame,t_s\n0,0\n1,0,033\n", {"frame", "t_s"});
                while (t.next()) {
                }
              }),
              testing::AllOf(testing::HasSubstr(":3: has 3 fields"), testing::HasSubstr("decimal commas"),
                             testing::HasSubstr("semicolons")));
}

TEST(Numbers, RatiosAreNumbersAndTrailingCharactersAreNot) {
  EXPECT_EQ(ratio_of("30000/1001"), 30000.0 / 1001);
  EXPECT_EQ(ratio_of("+2.5e1"), 25);
  for (const char* text : {"30/", "/1001", "30/0", "30/-1", "30 fps", "30,0", "1/2/3", "0x10", "", "1 "})
    EXPECT_EQ(ratio_of(text), std::nullopt) << text;
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
  EXPECT_EQ(first_number("a,c\n"), ":1: the header has no column b: it has a, c");
  EXPECT_EQ(first_number("a,b\n1,2\n1\n"), ":3: has 1 columns, at least 2 are needed");
  EXPECT_EQ(first_number("a,b\n1,two\n"), ":2: b must be a number, got \"two\"");
  EXPECT_EQ(error_of([&] {
              CsvTable t = table("t\n1e3s\n", {"t"});
              t.next();
              t.time(0);
            }),
            ":2: t must be a time in seconds, got \"1e3s\"");
  EXPECT_THROW(CsvTable("/no/such.csv", {}), ConfigError);
  EXPECT_THROW(CsvTable(testing::TempDir(), {}), ConfigError);
}

}  // namespace
}  // namespace huetrack::files
