#include "calib/yaml/yaml_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <functional>
#include <random>
#include <sstream>
#include <string>

namespace huetrack::yaml {
namespace {

using files::ConfigError;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

// The message of the ConfigError that `action` throws.
std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "no error";
}

YamlReader read(const std::string& yaml) {
  return YamlReader::text(yaml, "c.yaml");
}

constexpr std::array<std::string_view, 3> colours{"red", "green", "blue"};

TEST(YamlReader, ReadsEveryType) {
  const YamlReader r = read(R"(# a comment
real: -1.5e-3
whole_real: 7
positive: +2.5
count: 12
hex: 0x1F
exponent: 1e6
yes_: true
no_: False
text: hello world
quoted: "12"
plain_number_as_text: 0815
colour: green
list: [1, 2.5, -3]
block:
  - 4
  - 5
rows: [[1, 2], [3, 4]]
words: [a, "b c"]
map: {x: 1}
maps: [{x: 1}, {x: 2}]
named:
  zebra: {x: 1}
  ant: {x: 2}
)");
  EXPECT_EQ(r.number("real", any_number), -1.5e-3);
  EXPECT_EQ(r.number("whole_real", any_number), 7);
  EXPECT_EQ(r.number("positive", positive), 2.5);
  EXPECT_EQ(r.integer("count", any_number), 12);
  EXPECT_EQ(r.integer("hex", any_number), 31);
  EXPECT_EQ(r.integer("exponent", any_number), 1'000'000);
  EXPECT_TRUE(r.boolean("yes_"));
  EXPECT_FALSE(r.boolean("no_"));
  EXPECT_EQ(r.string("text"), "hello world");
  EXPECT_EQ(r.string("quoted"), "12");
  EXPECT_EQ(r.string("plain_number_as_text"), "0815");
  EXPECT_EQ(r.choice("colour", colours), "green");
  EXPECT_THAT(r.numbers("list", 1, 3, any_number), ElementsAre(1, 2.5, -3));
  EXPECT_THAT(r.numbers("block", 2, 2, any_number), ElementsAre(4, 5));
  EXPECT_THAT(r.rows("rows", 2, 2), ElementsAre(ElementsAre(1, 2), ElementsAre(3, 4)));
  EXPECT_THAT(r.strings("words"), ElementsAre("a", "b c"));
  const YamlReader map = r.map("map");
  EXPECT_EQ(map.integer("x", any_number), 1);
  EXPECT_EQ(map.line(), 20);
  ASSERT_EQ(r.maps("maps").size(), 2u);
  EXPECT_EQ(r.maps("maps")[1].integer("x", any_number), 2);
  const auto named = r.named_maps("named");
  ASSERT_EQ(named.size(), 2u);
  EXPECT_EQ(named[0].first, "zebra");  // the order of the file
  EXPECT_EQ(named[1].first, "ant");
  EXPECT_EQ(named[1].second.integer("x", any_number), 2);
  EXPECT_EQ(r.keys().size(), 19u);
  EXPECT_EQ(r.keys().front(), "real");
  EXPECT_NO_THROW(r.finish());
}

TEST(YamlReader, DefaultsApplyToAbsentKeysOnly) {
  const YamlReader r = read("a: 1\nnull_: ~\nempty:\n");
  EXPECT_EQ(r.number("n", positive, -4.0), -4.0);  // the program's own default is not checked
  EXPECT_EQ(r.integer("i", any_number, 7), 7);
  EXPECT_TRUE(r.boolean("b", true));
  EXPECT_EQ(r.string("s", ""), "");
  EXPECT_EQ(r.choice("c", colours, "red"), "red");
  EXPECT_FALSE(r.optional_map("m").has_value());
  EXPECT_EQ(r.number("a", positive, 9.0), 1);
  EXPECT_EQ(error_of([&] { r.number("null_", any_number, 1.0); }), "c.yaml:2: null_ must be a number, got nothing");
  EXPECT_EQ(error_of([&] { r.string("empty", "x"); }), "c.yaml:3: empty must be a text, got nothing");
  EXPECT_THAT(error_of([&] { r.optional_map("null_"); }),
              StartsWith("c.yaml:2: null_ must be a mapping (key: value), got nothing"));
}

struct Case {
  std::string yaml;
  std::function<void(const YamlReader&)> read;
  std::string message;
};

// Every error of every getter, word for word.
TEST(YamlReader, ErrorsNameTheMistakeAndItsPlace) {
  const auto number = [](Range range) { return [range](const YamlReader& r) { r.number("k", range); }; };
  const auto integer = [](Range range) { return [range](const YamlReader& r) { r.integer("k", range); }; };
  const auto boolean = [](const YamlReader& r) { r.boolean("k"); };
  const auto string = [](const YamlReader& r) { r.string("k"); };
  const auto choice = [](const YamlReader& r) { r.choice("k", colours); };
  const auto pair = [](const YamlReader& r) { r.numbers("k", 2, 2, non_negative); };
  const auto rows = [](const YamlReader& r) { r.rows("k", 2, 2); };
  const std::vector<Case> cases{
      {"k: abc", number(any_number), "c.yaml:1: k must be a number, got \"abc\""},
      {"k: '5'", number(any_number), "c.yaml:1: k must be a number, got \"5\": write 5, without quotation marks"},
      {"k: 5px", number(any_number), "c.yaml:1: k must be a number, got \"5px\": write 5, the number alone"},
      {"k: 0.5.1", number(any_number), "c.yaml:1: k must be a number, got \"0.5.1\""},
      {"k: .nan", number(any_number), "c.yaml:1: k must be a number, got \".nan\""},
      {"k: nan", number(any_number), "c.yaml:1: k must be a number, got \"nan\""},
      {"k: -.inf", number(any_number), "c.yaml:1: k must be a number, got \"-.inf\""},
      {"k: inf", number(any_number), "c.yaml:1: k must be a number, got \"inf\""},
      {"k: 1e999", number(any_number), "c.yaml:1: k must be a number, got \"1e999\""},
      {"k: +-5", number(any_number), "c.yaml:1: k must be a number, got \"+-5\""},
      {"k: [1]", number(any_number), "c.yaml:1: k must be a number, got a list of 1: write 1, without brackets"},
      {"k: {a: 1}", number(any_number), "c.yaml:1: k must be a number, got a mapping"},
      {"k: -3", number(positive), "c.yaml:1: k must be > 0 (is -3)"},
      {"k: 0", number(positive), "c.yaml:1: k must be > 0 (is 0)"},
      {"k: -0.5", number(non_negative), "c.yaml:1: k must be >= 0 (is -0.5)"},
      {"k: 2", number({.min = 0, .max = 1}), "c.yaml:1: k must be from 0 to 1 (is 2)"},
      {"k: 360", number({.min = 0, .max = 360, .max_is_open = true}), "c.yaml:1: k must be >= 0 and < 360 (is 360)"},
      {"k: 3", number({.max = 1}), "c.yaml:1: k must be <= 1 (is 3)"},
      {"x: 1", number(any_number), "c.yaml:1: k is missing (other keys here: x)"},
      {"k: 2.5", integer(any_number), "c.yaml:1: k must be a whole number, got \"2.5\""},
      {"k: 0x", integer(any_number), "c.yaml:1: k must be a whole number, got \"0x\""},
      {"k: 0x-5", integer(any_number), "c.yaml:1: k must be a whole number, got \"0x-5\""},
      {"k: 1e30", integer(any_number), "c.yaml:1: k must be a whole number, got \"1e30\""},
      {"k: 99999999999999999999", integer(any_number),
       "c.yaml:1: k must be a whole number, got \"99999999999999999999\""},
      {"k: 0", integer({.min = 1, .max = 9}), "c.yaml:1: k must be from 1 to 9 (is 0)"},
      {"k: yes", boolean, "c.yaml:1: k must be true or false, got \"yes\": write true"},
      {"k: 'true'", boolean, "c.yaml:1: k must be true or false, got \"true\": write true, without quotation marks"},
      {"k: ''", string, "c.yaml:1: k must not be empty"},
      {"k: [a]", string, "c.yaml:1: k must be a text, got a list of 1"},
      {"k: gren", choice, "c.yaml:1: k must be one of red, green, blue, got \"gren\" (did you mean green?)"},
      {"k: magenta", choice, "c.yaml:1: k must be one of red, green, blue, got \"magenta\""},
      {"k: abc", pair, "c.yaml:1: k must be a list of 2 numbers, got \"abc\""},
      {"k: [1, 2, 3]", pair,
       "c.yaml:1: k must be a list of 2 numbers, got a list of 3: decimals have a point, not a comma: 0.5"},
      {"k: [1]", [](const YamlReader& r) { r.numbers("k", 4, 8, any_number); },
       "c.yaml:1: k must be a list of 4 to 8 numbers, got a list of 1"},
      {"k:\n  - 1\n  - x", pair, "c.yaml:3: k[1] must be a number, got \"x\""},
      {"k:\n  - 1\n  - -7", pair, "c.yaml:3: k[1] must be >= 0 (is -7)"},
      {"k: [1, 2]", rows, "c.yaml:1: k[0] must be a list of 2 numbers, got \"1\""},
      {"k: [[1, 2]]", rows, "c.yaml:1: k must be a list of 2 rows of 2 numbers, got a list of 1"},
      {"k: [[1, 2],\n    [3, z]]", rows, "c.yaml:2: k[1][1] must be a number, got \"z\""},
      {"k: word", [](const YamlReader& r) { r.strings("k"); },
       "c.yaml:1: k must be a list of texts, got \"word\": write [word]"},
      {"k: [a, '']", [](const YamlReader& r) { r.strings("k"); }, "c.yaml:1: k[1] must not be empty"},
      {"k: 3", [](const YamlReader& r) { r.map("k"); }, "c.yaml:1: k must be a mapping (key: value), got \"3\""},
      {"k: {a: 1}", [](const YamlReader& r) { r.maps("k"); }, "c.yaml:1: k must be a list of mappings, got a mapping"},
      {"k:\n- {a: 1}\n- 5", [](const YamlReader& r) { r.maps("k"); },
       "c.yaml:3: k[1] must be a mapping (key: value), got \"5\""},
      {"k:\n  n: 5", [](const YamlReader& r) { r.named_maps("k"); },
       "c.yaml:2: k.n must be a mapping (key: value), got \"5\""},
      {"a: 1\nk:\n  n: {x: 5}", [](const YamlReader& r) { r.map("k").map("n").fail("x", "is too odd"); },
       "c.yaml:3: k.n.x: is too odd"},
      {"a: 1\nk:\n  n: 5", [](const YamlReader& r) { r.map("k").fail("absent", "is needed"); },
       "c.yaml:2: k.absent: is needed"},
      {"a: 1\nk:\n  n: 5", [](const YamlReader& r) { r.map("k").fail("", "is odd"); }, "c.yaml:2: k: is odd"},
  };
  for (const Case& c : cases) {
    EXPECT_EQ(error_of([&] { c.read(read(c.yaml)); }), c.message) << c.yaml;
  }
}

TEST(YamlReader, SuggestsTheKeyForAnUnknownOne) {
  const YamlReader r = read("version: 1\n\nobject_tracking:\n  seed: 3\n  particle_cuont: 500\n");
  r.integer("version", any_number);
  const YamlReader tracking = r.map("object_tracking");
  tracking.integer("seed", any_number);
  tracking.integer("particle_count", any_number, 500);
  EXPECT_EQ(error_of([&] { tracking.finish(); }),
            "c.yaml:5: object_tracking.particle_cuont is not a known key (did you mean particle_count?)");
  EXPECT_NO_THROW(r.finish());
  EXPECT_EQ(error_of([&] { read("banana: 1").finish(); }), "c.yaml:1: banana is not a known key");
}

TEST(YamlReader, ErrorForAMissingKeyPointsToItsMisspelling) {
  const YamlReader r = read("version: 1\nimage_szie: [1, 2]\n");
  r.integer("version", any_number);
  EXPECT_EQ(error_of([&] { r.numbers("image_size", 2, 2, any_number); }),
            "c.yaml:1: image_size is missing (is image_szie in line 2 a misspelling of it?)");
}

TEST(YamlReader, RejectsDuplicateKeys) {
  EXPECT_EQ(error_of([] { read("a: 1\nb: 2\na: 3\n"); }),
            "c.yaml:3: a is given twice, first in line 1: take one of them out, or write both as one");
  EXPECT_EQ(error_of([] { read("m:\n  a: 1\n  a: 1\n").map("m"); }),
            "c.yaml:3: m.a is given twice, first in line 2: take one of them out, or write both as one");
  EXPECT_THAT(error_of([] { read("cams:\n  l: {}\n  l: {}\n").named_maps("cams"); }),
              StartsWith("c.yaml:3: cams.l is given twice"));
}

TEST(YamlReader, RejectsControlCharacters) {
  EXPECT_EQ(error_of([] { read("a: 1\n\"b\\e[2J\": 2\n"); }), "c.yaml:2: b [2J has control characters in it");
  EXPECT_EQ(error_of([] { read("a: \"x\\ry\"\n").string("a"); }), "c.yaml:1: a has control characters in it");
  EXPECT_EQ(read("a: \"x\\ty\\nz\"\n").string("a"), "x\ty\nz");
}

TEST(YamlReader, RejectsWhatIsNotOneMapping) {
  EXPECT_EQ(error_of([] { read(""); }), "c.yaml: is empty");
  EXPECT_EQ(error_of([] { read("# only a comment\n"); }), "c.yaml: is empty");
  EXPECT_EQ(error_of([] { read("~"); }), "c.yaml: is empty");
  EXPECT_EQ(error_of([] { read("[1, 2]"); }), "c.yaml:1: the file must be a mapping (key: value), got a list of 2");
  const std::string second = "a second YAML document, or text that is not YAML, begins here";
  EXPECT_EQ(error_of([&] { read("a: 1\n---\nb: 2\n"); }), "c.yaml:2: " + second);
  EXPECT_EQ(error_of([&] { read("{a: 1}\n,\n"); }), "c.yaml:2: " + second);
  EXPECT_EQ(error_of([&] { read(","); }), "c.yaml:1: " + second);  // YAML::LoadAll never returns from this one
  EXPECT_EQ(error_of([] { read("[a]: 1"); }), "c.yaml:1: a key must be a word, got a list of 1");
  EXPECT_EQ(error_of([] { read("x: {'': 1}").map("x"); }), "c.yaml:1: x: a key must be a word, got \"\"");
  EXPECT_THAT(error_of([] { read("a: 1\nb: [1, 2\nc: 3\n"); }),
              StartsWith("c.yaml:2: is not valid YAML: [ is never closed"));
  EXPECT_THAT(error_of([] { read("a: 1\n\tb: 2\n"); }),
              "c.yaml:2: is not valid YAML: its indentation has a tab: write spaces, two for each level");
}

// What people write who know other formats, and what they are to write instead.
TEST(YamlReader, ErrorsSuggestTheCorrectText) {
  const auto number = [](const char* key) { return [key](const YamlReader& r) { r.number(key, any_number); }; };
  const auto whole = [](const YamlReader& r) { r.integer("k", any_number); };
  const auto pair = [](const YamlReader& r) { r.numbers("k", 2, 2, any_number); };
  const auto map = [](const YamlReader& r) { r.map("k"); };
  const auto nothing = [](const YamlReader&) {};
  const std::vector<Case> cases{
      {"r_m: 0,04", number("r_m"), "write 0.04: a decimal point, not a comma"},
      {"r_m: 40 mm", number("r_m"), "write 0.04: metres, without the unit"},
      {"square: 25 mm", number("square"), "write 0.025: metres, without the unit"},
      {"gap: 2,5cm", number("gap"), "write 0.025: metres, without the unit"},
      {"fx: 4 mm", number("fx"), "write 4, the number alone"},
      {"angle_deg: 3 mm", number("angle_deg"), "write 3, the number alone"},
      {"pitch: [25 mm, 25 mm]", [](const YamlReader& r) { r.numbers("pitch", 2, 2, any_number); },
       "c.yaml:1: pitch[0] must be a number, got \"25 mm\": write 0.025: metres, without the unit"},
      {"t_s: 30ms", number("t_s"), "write 0.03: seconds, without the unit"},
      {"k: 30%", number("k"), "write 0.3: a share, without the unit"},
      {"k: 1,000", whole, "write 1000, without the comma"},
      {"k: '3'", whole, "write 3, without quotation marks"},
      {"k: 10-20", pair, "write [10, 20]"},
      {"k: 640*480", pair, "write [640, 480]"},
      {"k: 640x480", pair, "write [640, 480]"},
      {"k: -5..5", pair, "write [-5, 5]"},
      {"k: [0.5 1]", pair, "write [0.5, 1]"},
      {"k: [[3, 4]]", pair, "write [3, 4]"},
      {"k: {min: 3, max: 4}", pair, "write [3, 4]"},
      {"k: [0,5, 1]", pair, "decimals have a point, not a comma: 0.5"},
      {"k:\n- a: 1\n", map, "write its keys without the dashes or brackets of a list, a: ..."},
      {"k:\na: 1\n", map, "its keys belong on the lines below it, indented further than it"},
      {"{a: 8,5}", [](const YamlReader& r) { r.number("a", any_number), r.finish(); },
       "c.yaml:1: a is 8,5, with a decimal comma: write 8.5"},
      {"{a: 29,97, b: 1}", [](const YamlReader& r) { r.number("a", any_number), r.finish(); },
       "c.yaml:1: a is 29,97, with a decimal comma: write 29.97"},
      {"{b: x, 5: 1}", [](const YamlReader& r) { r.string("b"), r.finish(); },
       "decimals have a point, not a comma: 0.5"},
      {"b: 1", [](const YamlReader& r) { r.has("one"), r.has("two"), r.finish(); }, "known are: one, two"},
      {"version: 2", [](const YamlReader& r) { r.version(1); }, "neither the program's version nor a count"},
      {"version: '1'", [](const YamlReader& r) { r.version(1); }, "write 1, without quotation marks"},
      {"a: 1", [](const YamlReader& r) { r.version(1); }, "write version: 1, the version of the file format"},
      {"a:1\nb: 2", nothing, "a space is missing after the colon: write a: 1"},
      {"a = 1\nb: 2", nothing, "write a: 1, with a colon"},
      {"a\n  b: 2", nothing, "a colon is missing after a: write a:"},
      {"a: b: 2", nothing, "write a: {b: 2}, or b on a line of its own, indented further"},
      {"a: @b", nothing, "put quotation marks around what begins with @: write a: \"@b\""},
      {"a: {b: 1\nc: 2", nothing, "{ is never closed: write } where it ends"},
      {"a: 1\n   b: 2", nothing, "it is indented by 3 spaces, but the line above it"},
      {"a:\n    b: 2\n  c: 3", nothing, "it is indented by 2 spaces, like no line above it"},
      {"a:\n\u00a0\u00a0b: 2\nc: 3: 4", nothing, "no-break spaces"},
  };
  for (const Case& c : cases) EXPECT_THAT(error_of([&] { c.read(read(c.yaml)); }), HasSubstr(c.message)) << c.yaml;
}

TEST(YamlReader, AMissingKeyComesWithTheKeysThatMayStandForIt) {
  const auto missing = [](const std::string& yaml) {
    return error_of([&] {
      const YamlReader r = read(yaml);
      r.has("type"), r.number("hue_deg", any_number);
    });
  };
  EXPECT_EQ(missing("{type: a, hsv: [1, 2]}"), "c.yaml:1: hue_deg is missing (other keys here: hsv)");
  EXPECT_EQ(missing("{type: a}"), "c.yaml:1: hue_deg is missing");
  EXPECT_EQ(missing("{a: 1, b: 1, c: 1, d: 1, e: 1, f: 1, g: 1, h: 1}"),
            "c.yaml:1: hue_deg is missing (other keys here: a, b, c, d, e, f, ...)");
  EXPECT_EQ(missing("{hue_dg: 1, x: 1}"), "c.yaml:1: hue_deg is missing (is hue_dg in line 1 a misspelling of it?)");
}

TEST(YamlReader, SuggestsThePlaceOfAMisplacedKey) {
  const std::vector<KeyPath> all{{"volume"}, {"object_tracking", "volume"}, {"targets", "NAME", "color", "hue_deg"}};
  const auto of = [&](const std::string& yaml) {
    const YamlReader r = read(yaml);
    r.has("camera_tracking"), r.has("object_tracking");
    return error_of([&] { r.finish(all); });
  };
  EXPECT_EQ(of("volume: 1"), "c.yaml:1: volume is not a known key here (did you mean object_tracking.volume?)");
  EXPECT_EQ(of("hue: 1"), "c.yaml:1: hue is not a known key here (did you mean targets.NAME.color.hue_deg?)");
  EXPECT_EQ(of("tracking: 1"),
            "c.yaml:1: tracking is not a known key (did you mean camera_tracking or object_tracking?)");
}

TEST(YamlReader, MessagesAreOneShortLine) {
  const std::string message = error_of([] { read("k: \"line\\nbreak " + std::string(500, 'x') + "\"").boolean("k"); });
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_LT(message.size(), 120u);
  EXPECT_THAT(message, StartsWith("c.yaml:1: k must be true or false, got \"line break xxx"));
}

TEST(YamlReader, ErrorNamesAnUnreadableFileAsGiven) {
  EXPECT_EQ(error_of([] { YamlReader::file("no/such/./rig.yaml"); }),
            "no/such/./rig.yaml: cannot be read: No such file or directory; there is no folder no/such/.");
  EXPECT_EQ(error_of([] { YamlReader::file("/proc/self"); }), "/proc/self: is a directory, not a file");
  EXPECT_EQ(error_of([] { YamlReader::file("/dev/zero"); }), "/dev/zero: is a device, a pipe or a socket, not a file");
  EXPECT_EQ(error_of([] { YamlReader::file("~/rig.yaml"); }),
            "~/rig.yaml: cannot be read: No such file or directory; there is no folder ~");
}

TEST(YamlReader, ReadsAFileAndKeepsItsName) {
  const std::string path = testing::TempDir() + "yaml_reader_test.yaml";
  std::ofstream(path) << "\xEF\xBB\xBF"
                      << "a: 1\r\nb: x\r\n";  // a byte order mark and DOS line ends
  const YamlReader r = YamlReader::file(path);
  EXPECT_EQ(r.path(), path);
  EXPECT_EQ(r.integer("a", any_number), 1);
  EXPECT_EQ(r.string("b"), "x");
  EXPECT_EQ(error_of([&] { r.boolean("b"); }), path + ":2: b must be true or false, got \"x\"");
}

// ---- One file read over another.

YamlReader patched(const std::string& yaml, const std::string& patch) {
  return YamlReader::text(yaml, "c.yaml").patched_with(YamlReader::text(patch, "p.yaml"));
}

TEST(PatchedWith, MergesMappingsReplacesOtherValuesAndNullRemoves) {
  const YamlReader r = patched("a: 1\nb: {x: 1, y: [1, 2], z: {q: 1}}\nc: word\nd: 4\nl: {m: 1}\n",
                               "b: {y: [3], z: {q: 2, r: 3}, w: 5}\nc: null\ne: 6\nl: 7\nn: {o: {p: 8, s: null}}\n");
  EXPECT_THAT(r.keys(), ElementsAre("a", "b", "d", "l", "e", "n"));
  EXPECT_EQ(r.integer("a", any_number), 1);
  const YamlReader b = r.map("b");
  EXPECT_EQ(b.integer("x", any_number), 1);
  EXPECT_THAT(b.numbers("y", 0, 9, any_number), ElementsAre(3));
  EXPECT_EQ(b.map("z").integer("q", any_number), 2);
  EXPECT_EQ(b.map("z").integer("r", any_number), 3);
  EXPECT_EQ(b.integer("w", any_number), 5);
  EXPECT_FALSE(r.has("c"));
  EXPECT_EQ(r.string("c", "default"), "default");
  EXPECT_EQ(r.integer("d", any_number), 4);
  EXPECT_EQ(r.integer("e", any_number), 6);
  EXPECT_EQ(r.integer("l", any_number), 7);
  EXPECT_THAT(r.map("n").map("o").keys(), ElementsAre("p"));
  r.finish();
}

TEST(PatchedWith, MergesNamedMappingsByName) {
  const YamlReader r =
      patched("n:\n  a: {x: 1, y: 1}\n  b: {x: 2}\n  c: {x: 3}\n", "n: {b: null, c: {x: 4}, d: {x: 5}}\n");
  std::string seen;
  for (const auto& [name, map] : r.named_maps("n")) seen += name + std::to_string(map.integer("x", any_number));
  EXPECT_EQ(seen, "a1c4d5");
}

TEST(PatchedWith, LeavesItsArgumentsUnchanged) {
  const YamlReader file = YamlReader::text("a: {x: 1}\nb: 2\n", "c.yaml"),
                   patch = YamlReader::text("a: 3\nb: {y: 4}\n", "p.yaml");
  const YamlReader merged = file.patched_with(patch);
  EXPECT_EQ(merged.integer("a", any_number), 3);
  EXPECT_EQ(merged.map("b").integer("y", any_number), 4);
  EXPECT_EQ(file.map("a").integer("x", any_number), 1);
  EXPECT_EQ(file.integer("b", any_number), 2);
  EXPECT_EQ(patch.integer("a", any_number), 3);
  // And again: the last one is on top.
  const YamlReader twice = file.patched_with(YamlReader::text("a: {x: 5, y: 5}\n", "p.yaml"))
                               .patched_with(YamlReader::text("a: {x: 6}\n", "q.yaml"));
  EXPECT_EQ(twice.map("a").integer("x", any_number), 6);
  EXPECT_EQ(twice.map("a").integer("y", any_number), 5);
}

TEST(PatchedWith, MessagesNameTheFileOfTheValue) {
  const YamlReader r = patched("a: 1\nm:\n  x: 1\n  z: 1\n", "\n\na: [1,\n  two]\nm:\n  x: two\n  y: null\n  w: 1\n");
  EXPECT_EQ(error_of([&] { r.numbers("a", 0, 9, any_number); }), "p.yaml:4: a[1] must be a number, got \"two\"");
  const YamlReader m = r.map("m");
  EXPECT_EQ(error_of([&] { m.integer("x", any_number); }), "p.yaml:6: m.x must be a whole number, got \"two\"");
  EXPECT_EQ(error_of([&] { m.boolean("z"); }), "c.yaml:4: m.z must be true or false, got \"1\": write true");
  EXPECT_EQ(error_of([&] { m.integer("q", any_number); }), "c.yaml:2: m.q is missing (other keys here: w)");
  EXPECT_EQ(error_of([&] { m.fail("x", "no"); }), "p.yaml:6: m.x: no");
  EXPECT_EQ(error_of([&] { r.fail("m", "no"); }), "c.yaml:2: m: no (p.yaml:5 is read over it)");
  // What is taken away must be a known key, too.
  EXPECT_EQ(error_of([&] { m.finish(); }), "p.yaml:7: m.y is not a known key; known here: x, z, q");
  m.has("y");
  EXPECT_EQ(error_of([&] { m.finish(); }), "p.yaml:8: m.w is not a known key; known here: x, z, q, y");
}

TEST(Leaves, AreValuesThatAreNotMappings) {
  std::string all;
  for (const auto& [path, is_null] : read("a: 1\nb: {c: [1, {d: 2}], e: {}, f.g: ~}\nh:\n").leaves()) {
    for (const auto& key : path) all += "/" + key;
    all += is_null ? " null\n" : "\n";
  }
  EXPECT_EQ(all, "/a\n/b/c\n/b/e\n/b/f.g null\n/h null\n");
}

TEST(YamlReader, DeepAndCircularFilesDoNotCrash) {
  for (const std::string open : {"[", "{a: ", "- ", "? ", "&a [", "!t ["}) {
    std::string deep = "k: ";
    for (int i = 0; i < 20'000; ++i) deep += open;
    EXPECT_THAT(error_of([&] { read(deep).finish(); }), StartsWith("c.yaml:")) << open;
  }
  // "A billion laughs": 2^40 elements if aliases were expanded.
  std::string laughs = "a0: &a0 {x: 1, y: 2}\n";
  for (int i = 1; i < 40; ++i) {
    std::ostringstream line;
    line << "a" << i << ": &a" << i << " {x: *a" << i - 1 << ", y: *a" << i - 1 << "}\n";
    laughs += line.str();
  }
  EXPECT_EQ(read(laughs).map("a39").map("x").map("y").keys().size(), 2u);
  EXPECT_EQ(error_of([] { read("a: &a [*a]").strings("a"); }), "c.yaml:1: a[0] must be a text, got a list of 1");
}

TEST(YamlReader, ReadsALongMappingInLinearTime) {
  std::ostringstream yaml;
  for (int i = 0; i < 50'000; ++i) yaml << "key" << i << ": 1\n";
  EXPECT_EQ(read(yaml.str()).keys().size(), 50'000u);
}

// Reads every key with every getter.
void read_everything(const YamlReader& r, int depth) {
  const auto tolerant = [](const std::function<void()>& action) {
    try {
      action();
    } catch (const ConfigError&) {  // expected of a damaged file
    }
  };
  for (const auto& key : r.keys()) {
    tolerant([&] { r.number(key, positive); });
    tolerant([&] { r.integer(key, positive); });
    tolerant([&] { r.boolean(key); });
    tolerant([&] { r.string(key); });
    tolerant([&] { r.choice(key, colours); });
    tolerant([&] { r.numbers(key, 0, 9, any_number); });
    tolerant([&] { r.rows(key, 3, 3); });
    tolerant([&] { r.strings(key); });
    tolerant([&] { r.maps(key); });
    if (depth < 5) {
      tolerant([&] {
        for (const auto& [name, map] : r.named_maps(key)) read_everything(map, depth + 2);
      });
      tolerant([&] { read_everything(r.map(key), depth + 1); });
    }
  }
  tolerant([&] { r.number("not there", any_number); });
  tolerant([&] { r.finish(); });
}

TEST(YamlReader, DamagedFilesAreReadOrRejected) {
  const std::string valid = R"(# rig
version: 1
cameras:
  left: &l
    image_size: [320, 240]   # pixels
    model: pinhole_radtan
    intrinsics: {fx: 256.054, fy: 2.5e2, cx: 157.4, cy: 121.2}
    rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
  right: *l
made_by:
  "tool": 'huetrack-calibrate'
  text: |
    two
    lines
list:
  - {a: true}
  - {a: ~}
)";
  const std::string syntax = "{}[]:,-?&*!|>'\"%@`#\n\t \\~<=";
  std::mt19937_64 rng(20);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(rng() % n); };
  int refused = 0, read_through = 0;
  for (int i = 0; i < 4000; ++i) {
    std::string damaged = valid;
    switch (below(4)) {
      case 0:
        damaged.resize(below(valid.size()));
        break;
      case 1:  // random bytes alone
        damaged.resize(below(200));
        for (char& c : damaged) c = static_cast<char>(rng());
        break;
      case 2:
        for (std::size_t n = 1 + below(8); n > 0; --n) damaged[below(damaged.size())] = static_cast<char>(rng());
        break;
      default:
        for (std::size_t n = 1 + below(8); n > 0; --n) {
          damaged.insert(below(damaged.size()), 1, syntax[below(syntax.size())]);
          damaged.erase(below(damaged.size()), below(3));
        }
    }
    try {
      read_everything(YamlReader::text(damaged, "c.yaml"), 0);
      ++read_through;
    } catch (const ConfigError& error) {
      ASSERT_THAT(error.what(), StartsWith("c.yaml:"));
      ASSERT_THAT(error.what(), testing::Not(HasSubstr("\n")));
      ++refused;
    } catch (const std::exception& error) {
      FAIL() << "attempt " << i << ": " << error.what() << " for\n" << damaged;
    }
  }
  EXPECT_GT(refused, 500);  // both happen, or the test is not testing
  EXPECT_GT(read_through, 500);
}

}  // namespace
}  // namespace huetrack::yaml
