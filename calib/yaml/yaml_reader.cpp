#include "calib/yaml/yaml_reader.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "calib/files/nearest_word.h"
#include "calib/files/text_file.h"
#include "calib/yaml/hints.h"

namespace huetrack::yaml {

using files::ConfigError;
using files::nearest_word;
using files::printable;

namespace {

constexpr std::size_t longest_key = 80;  // capacity: characters of a key in a message

// Names and texts are printed sooner or later: none may contain commands for a terminal.
constexpr const char* not_printable = "has control characters in it";

std::string in_quotes(std::string_view text) {
  return '"' + printable(text) + '"';
}

std::string to_text(double value) {
  std::array<char, 32> buffer;
  // The shortest text of a million is 1e+06, which is less readable.
  const bool plain = value == 0 || (std::abs(value) >= 1e-4 && std::abs(value) < 1e16);
  return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                       plain ? std::chars_format::fixed : std::chars_format::general)
                             .ptr};
}

std::string plural(std::size_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string as_end(const std::string& hint) {
  return hint.empty() ? hint : ": " + hint;
}

// "camera_tracking or object_tracking"
std::string one_of(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " or "));
}

std::string list_of(std::size_t min_count, std::size_t max_count) {
  if (min_count == max_count) return "must be a list of " + plural(min_count, "number");
  if (max_count == std::numeric_limits<std::size_t>::max()) {
    return "must be a list of at least " + plural(min_count, "number");
  }
  return "must be a list of " + std::to_string(min_count) + " to " + plural(max_count, "number");
}

bool is_null(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return true;
  const std::string& tag = node.Tag();
  return node.IsScalar() && tag == "?" && (node.Scalar().empty() || node.Scalar() == "~");
}

// A scalar that is neither quoted nor tagged: the only kind that may be a number or a boolean.
bool is_plain(const YAML::Node& node) {
  return node.IsScalar() && node.Tag() == "?";
}

std::string described(const YAML::Node& node) {
  if (is_null(node)) return "nothing";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  if (node.IsMap()) return "a mapping";
  return in_quotes(node.Scalar());
}

std::optional<std::int64_t> parse_integer(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  int base = 10;
  std::string_view digits = text;
  if (text.starts_with("0x") || text.starts_with("0o")) {
    base = text[1] == 'x' ? 16 : 8;
    digits.remove_prefix(2);
    if (digits.starts_with('-')) return std::nullopt;
  }
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, base);
  if (error == std::errc{} && end == digits.data() + digits.size()) return value;
  // 1e6 and 500.0 are whole numbers too; beyond 2^53 a double would have rounded.
  const auto real = parse_number(text);
  if (!real || *real != std::trunc(*real) || std::abs(*real) > 0x1p53) return std::nullopt;
  return static_cast<std::int64_t>(*real);
}

// The hint for a list of one number where a number is expected.
std::string in_brackets(const YAML::Node& node) {
  if (!node.IsSequence() || node.size() != 1 || !is_plain(node[0]) || !parse_number(node[0].Scalar())) return {};
  return "write " + printable(node[0].Scalar()) + ", without brackets";
}

std::string hint_of_number(const YAML::Node& node, std::string_view key, NumberKind wanted) {
  if (is_null(node)) return {};
  return node.IsScalar() ? number_hint(node.Scalar(), key, wanted) : in_brackets(node);
}

// The hint for a value that should be a list of numbers.
std::string hint_of_list(const YAML::Node& node, std::size_t min_count, std::size_t max_count) {
  if (is_null(node)) return {};
  if (node.IsScalar()) return list_hint(node.Scalar(), min_count, max_count);
  std::string all;
  constexpr std::size_t most = 500;  // capacity: numbers in a message
  const auto add = [&all](const YAML::Node& value) {
    if (value.IsScalar()) all += value.Scalar() + " ; ";
  };
  if (node.size() > most) return {};
  if (node.IsMap())
    for (const auto& pair : node) add(pair.second);
  if (node.IsSequence()) {
    const auto is_whole = [](const YAML::Node& n) { return is_plain(n) && parse_integer(n.Scalar()).has_value(); };
    if (node.size() == max_count + 1 && std::all_of(node.begin(), node.end(), is_whole))
      return "decimals have a point, not a comma: 0.5";  // [0,5, 1] has three elements
    for (const auto& element : node) {
      if (element.IsSequence() && node.size() == 1)
        for (const auto& inner : element) add(inner);
      add(element);
    }
  }
  return list_hint(all, min_count, max_count);
}

// The hint for a value that should be a mapping.
std::string hint_of_mapping(const YAML::Node& node) {
  if (is_null(node)) return "its keys belong on the lines below it, indented further than it";
  if (!node.IsSequence() || node.size() == 0) return {};
  const YAML::Node first = node[0];
  if (first.IsMap() && first.size() > 0 && first.begin()->first.IsScalar())
    return "write its keys without the dashes or brackets of a list, " + printable(first.begin()->first.Scalar()) +
           ": ...";
  return {};
}

bool contains(const Range& range, double value) {
  return (range.min_is_open ? value > range.min : value >= range.min) &&
         (range.max_is_open ? value < range.max : value <= range.max);
}

std::string described(const Range& range) {
  if (range.min == range.max) return to_text(range.min);
  const bool has_min = std::isfinite(range.min), has_max = std::isfinite(range.max);
  if (has_min && has_max && !range.min_is_open && !range.max_is_open) {
    return "from " + to_text(range.min) + " to " + to_text(range.max);
  }
  std::string text;
  if (has_min) text = (range.min_is_open ? "> " : ">= ") + to_text(range.min);
  if (has_min && has_max) text += " and ";
  if (has_max) text += (range.max_is_open ? "< " : "<= ") + to_text(range.max);
  return text;
}

// Records the line where the last document starts.
class DocumentStarts : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark& mark) override { line_ = mark.line + 1; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
  int line() const { return line_; }

 private:
  int line_ = 0;
};

// Parses a file of one document. YAML::Load ignores what follows the first document, and YAML::LoadAll never ends (and
// exhausts the memory) if that is a stray "," or "}": https://github.com/jbeder/yaml-cpp/pull/1319
YAML::Node parse(const std::string& yaml, const std::string& name) {
  try {
    const YAML::Node document = YAML::Load(yaml);
    std::istringstream stream(yaml);
    YAML::Parser parser(stream);
    DocumentStarts starts;
    if (parser.HandleNextDocument(starts) && parser.HandleNextDocument(starts)) {
      throw ConfigError(name, starts.line(), "a second YAML document, or text that is not YAML, begins here");
    }
    return document;
  } catch (const YAML::Exception& error) {
    const int line = error.mark.line + 1;
    if (const SyntaxHint hint = syntax_hint(yaml, line); !hint.text.empty())
      throw ConfigError(name, hint.line, "is not valid YAML: " + hint.text);
    throw ConfigError(name, line,
                      "is not valid YAML: " + error.msg + " (column " + std::to_string(error.mark.column + 1) + ")");
  }
}

// At most two other places for a key of this name, or one that begins with it: "object_tracking.volume".
std::vector<std::string> of_other_places(const std::string& key, std::span<const KeyPath> paths) {
  std::vector<std::string> places;
  const auto add = [&](const auto& is_it) {
    constexpr std::size_t most = 2;
    for (const KeyPath& path : paths)
      if (places.size() < most && path.size() > 1 && is_it(path.back()))
        places.push_back(fmt::format("{}", fmt::join(path, ".")));
  };
  add([&](const std::string& name) { return name == key; });
  if (places.empty()) add([&](const std::string& name) { return name.starts_with(key + "_"); });
  return places;
}

// "8,5" in braces parses as 8 and a key 5.
bool is_decimal_comma(std::string_view key) {
  return key.find_first_not_of("0123456789") == std::string_view::npos;
}

}  // namespace

struct YamlReader::Node {
  // A key with its value and origin.
  struct Entry {
    // const: entries must not be assigned; assigning a YAML::Node changes its document.
    const std::string key;
    YAML::Node value;
    std::filesystem::path file;
    int line;                    // of the key
    bool is_removed = false;     // by a patch: counts as known, but is not read
    std::vector<Entry> patches;  // of a mapping: mappings applied over it, in this order

    void replace_with(const Entry& other) {
      value.reset(other.value);
      file = other.file;
      line = other.line;
      is_removed = other.is_removed;
      patches.clear();
    }
  };

  std::filesystem::path file;
  std::string path;  // dotted; empty at the root
  int line;
  std::vector<Entry> entries;
  std::map<std::string, std::size_t, std::less<>> places;  // index in entries, by key: a file may have 100,000 keys
  std::vector<std::string> requested;
  std::set<std::string, std::less<>> requested_keys;  // the same, for look-up
  // Of an absent mapping that was read as an empty one: its parent and key.
  std::shared_ptr<Node> absent_from = nullptr;
  std::string absent_key = {};

  // Reads one level of a YAML mapping: aliases may make the tree below exponentially large or circular.
  Node(std::filesystem::path file_name, std::string key_path, int line_number, const YAML::Node& yaml)
      : file(std::move(file_name)), path(std::move(key_path)), line(line_number) {
    if (!yaml.IsMap()) {
      throw ConfigError(file, line,
                        (path.empty() ? "the file" : path) + " must be a mapping (key: value), got " + described(yaml) +
                            as_end(hint_of_mapping(yaml)));
    }
    for (const auto& pair : yaml) {
      const int key_line = pair.first.Mark().line + 1;
      if (!pair.first.IsScalar() || pair.first.Scalar().empty()) {
        throw ConfigError(file, key_line > 0 ? key_line : line,
                          (path.empty() ? "" : path + ": ") + "a key must be a word, got " + described(pair.first));
      }
      const std::string& key = pair.first.Scalar();
      if (files::has_control_characters(key)) throw ConfigError(file, key_line, child(key) + " " + not_printable);
      if (const Entry* first = entry_of(key)) {
        throw ConfigError(file, key_line,
                          child(key) + " is given twice, first in line " + std::to_string(first->line) +
                              ": take one of them out, or write both as one");
      }
      add({.key = key, .value = pair.second, .file = file, .line = key_line, .patches = {}});
    }
  }

  Entry& add(Entry entry) {
    places.emplace(entry.key, entries.size());
    return entries.emplace_back(std::move(entry));
  }
  // nullptr: absent.
  Entry* entry_of(std::string_view key) {
    const auto place = places.find(key);
    return place == places.end() ? nullptr : &entries[place->second];
  }

  // One level, like the constructor: the mappings below are merged when they are read.
  void patch_with(const Node& patch) {
    for (const Entry& over : patch.entries) {
      Entry* entry = entry_of(over.key);
      const bool is_new = entry == nullptr;
      if (is_new) entry = &add(over);
      if (!over.value.IsMap()) {
        entry->replace_with(over);
        entry->is_removed = is_null(over.value);
        continue;
      }
      // A mapping over nothing patches an empty mapping, so that null in it removes here, too.
      if (is_new || entry->is_removed || !entry->value.IsMap()) {
        entry->replace_with(over);
        entry->value.reset(YAML::Node(YAML::NodeType::Map));
      }
      entry->patches.push_back(over);
    }
  }

  std::string child(std::string_view key) const {
    const std::string shown = printable(key, longest_key);
    return path.empty() ? shown : key.empty() ? path : path + "." + shown;
  }

  const Entry* find(std::string_view key) {
    if (!requested_keys.contains(key)) requested_keys.insert(requested.emplace_back(key));
    const Entry* entry = entry_of(key);
    return entry == nullptr || entry->is_removed ? nullptr : entry;
  }

  const Entry& required(std::string_view key) {
    if (const Entry* entry = find(key)) return *entry;
    if (absent_from != nullptr) {
      if (const std::string hint = absent_from->misspelt(absent_key); !hint.empty())
        throw ConfigError(file, line, path + " is missing" + hint);
    }
    const std::string hint = misspelt(key);
    throw ConfigError(file, line, child(key) + " is missing" + (hint.empty() ? unrequested_keys() : hint));
  }

  // " (other keys here: hsv)": one of them may stand for the key that is missing. Whether they are known is only
  // certain once every key was requested.
  std::string unrequested_keys() const {
    constexpr std::size_t most = 6;  // capacity: keys in a message
    std::vector<std::string> shown;
    for (const Entry& entry : entries) {
      if (entry.is_removed || requested_keys.contains(entry.key)) continue;
      shown.push_back(shown.size() < most ? printable(entry.key, longest_key) : "...");
      if (shown.size() > most) break;
    }
    return shown.empty() ? "" : fmt::format(" (other keys here: {})", fmt::join(shown, ", "));
  }

  // " (is colour in line 3 a misspelling of it?)"; empty: no unrequested key is similar.
  std::string misspelt(std::string_view key) const {
    std::vector<std::string> unrequested;
    for (const Entry& entry : entries) {
      if (!requested_keys.contains(entry.key)) unrequested.push_back(entry.key);
    }
    const auto near = nearest_word(key, unrequested);
    if (!near) return {};
    const auto entry = std::ranges::find(entries, *near, &Entry::key);
    return " (is " + *near + " in line " + std::to_string(entry->line) + " a misspelling of it?)";
  }

  [[noreturn]] void fail(const Entry& entry, const std::string& message, const std::string& index = "") const {
    throw ConfigError(entry.file, entry.line, child(entry.key) + index + " " + message);
  }

  // {fps: 29,97} has the keys fps and 97.
  [[noreturn]] void fail_at_decimal_comma(const Entry& digits) const {
    const Entry* before = &digits == entries.data() ? nullptr : &digits - 1;
    if (before != nullptr && before->line == digits.line && is_plain(before->value) &&
        parse_integer(before->value.Scalar()))
      fail(*before, fmt::format("is {0},{1}, with a decimal comma: write {0}.{1}", before->value.Scalar(),
                                files::printable(digits.key)));
    fail(digits, "is not a known key: decimals have a point, not a comma: 0." + files::printable(digits.key));
  }

  // Reports an element of a list at its own line; a list may span lines. Null has no position.
  [[noreturn]] void fail(const Entry& entry, const YAML::Node& element, const std::string& index,
                         const std::string& message) const {
    const int element_line = index.empty() || is_null(element) ? 0 : element.Mark().line + 1;
    throw ConfigError(entry.file, element_line > 0 ? element_line : entry.line,
                      child(entry.key) + index + " " + message);
  }

  double number(const Entry& entry, const YAML::Node& value, const std::string& index, Range range) const {
    const auto parsed = is_plain(value) ? parse_number(value.Scalar()) : std::nullopt;
    if (!parsed)
      fail(entry, value, index,
           "must be a number, got " + described(value) + as_end(hint_of_number(value, entry.key, NumberKind::number)));
    if (!contains(range, *parsed)) {
      fail(entry, value, index, "must be " + described(range) + " (is " + to_text(*parsed) + ")");
    }
    return *parsed;
  }

  std::string string(const Entry& entry, const YAML::Node& value, const std::string& index) const {
    if (is_null(value) || !value.IsScalar()) fail(entry, value, index, "must be a text, got " + described(value));
    if (value.Scalar().empty()) fail(entry, value, index, "must not be empty");
    std::string shown = value.Scalar();
    std::ranges::replace(shown, '\n', ' ');  // a line break is harmless
    if (files::has_control_characters(shown)) fail(entry, value, index, not_printable);
    return value.Scalar();
  }

  std::vector<double> numbers(const Entry& entry, const YAML::Node& list, const std::string& index,
                              std::size_t min_count, std::size_t max_count, Range range) const {
    if (!list.IsSequence() || list.size() < min_count || list.size() > max_count) {
      fail(entry, list, index,
           list_of(min_count, max_count) + ", got " + described(list) +
               as_end(hint_of_list(list, min_count, max_count)));
    }
    std::vector<double> values;
    values.reserve(list.size());
    for (const auto& element : list) {
      values.push_back(number(entry, element, index + "[" + std::to_string(values.size()) + "]", range));
    }
    return values;
  }

  std::shared_ptr<Node> map(const Entry& entry) const {
    auto merged = std::make_shared<Node>(entry.file, child(entry.key), entry.line, entry.value);
    for (const Entry& patch : entry.patches)
      merged->patch_with(Node(patch.file, merged->path, patch.line, patch.value));
    return merged;
  }

  void add_leaves(const KeyPath& above, std::vector<Leaf>& leaves) const {
    for (const Entry& entry : entries) {
      KeyPath here = above;
      here.push_back(entry.key);
      const auto below = entry.value.IsMap() ? map(entry) : nullptr;
      if (below && !below->entries.empty()) {
        below->add_leaves(here, leaves);
      } else {
        leaves.push_back({std::move(here), is_null(entry.value)});
      }
    }
  }
};

YamlReader::YamlReader(std::shared_ptr<Node> node) : node_(std::move(node)) {}

YamlReader YamlReader::file(const std::filesystem::path& path) {
  return text(files::read_text_file(path), path.string());
}

YamlReader YamlReader::text(const std::string& yaml, const std::string& name) {
  const YAML::Node document = parse(yaml, name);
  if (is_null(document)) throw ConfigError(name, 0, "is empty");
  return YamlReader(std::make_shared<Node>(name, "", 1, document));
}

YamlReader YamlReader::patched_with(const YamlReader& patch) const {
  auto merged = std::make_shared<Node>(*node_);
  merged->patch_with(*patch.node_);
  return YamlReader(std::move(merged));
}

std::vector<YamlReader::Leaf> YamlReader::leaves() const {
  std::vector<Leaf> leaves;
  node_->add_leaves({}, leaves);
  return leaves;
}

bool YamlReader::has(std::string_view key) const {
  return node_->find(key) != nullptr;
}

double YamlReader::number(std::string_view key, Range range) const {
  const auto& entry = node_->required(key);
  return node_->number(entry, entry.value, "", range);
}

std::int64_t YamlReader::integer(std::string_view key, Range range) const {
  const auto& entry = node_->required(key);
  const auto value = is_plain(entry.value) ? parse_integer(entry.value.Scalar()) : std::nullopt;
  if (!value)
    node_->fail(entry, "must be a whole number, got " + described(entry.value) +
                           as_end(hint_of_number(entry.value, key, NumberKind::whole_number)));
  if (!contains(range, static_cast<double>(*value))) {
    node_->fail(entry, "must be " + described(range) + " (is " + std::to_string(*value) + ")");
  }
  return *value;
}

bool YamlReader::boolean(std::string_view key) const {
  const auto& entry = node_->required(key);
  if (is_plain(entry.value)) {
    const std::string& word = entry.value.Scalar();
    if (word == "true" || word == "True" || word == "TRUE") return true;
    if (word == "false" || word == "False" || word == "FALSE") return false;
  }
  const bool is_word = !is_null(entry.value) && entry.value.IsScalar();
  node_->fail(entry, "must be true or false, got " + described(entry.value) +
                         as_end(is_word ? boolean_hint(entry.value.Scalar()) : ""));
}

bool YamlReader::is_list(std::string_view key) const {
  return has(key) && node_->required(key).value.IsSequence();
}

std::string YamlReader::string(std::string_view key) const {
  const auto& entry = node_->required(key);
  return node_->string(entry, entry.value, "");
}

std::string YamlReader::choice(std::string_view key, std::span<const std::string_view> words) const {
  const auto& entry = node_->required(key);
  const std::string word = node_->string(entry, entry.value, "");
  if (std::ranges::find(words, word) != words.end()) return word;
  const auto near = nearest_word(word, std::vector<std::string>(words.begin(), words.end()));
  node_->fail(entry, fmt::format("must be one of {}, got {}{}", fmt::join(words, ", "), in_quotes(word),
                                 near ? " (did you mean " + *near + "?)" : ""));
}

std::vector<double> YamlReader::numbers(std::string_view key, std::size_t min_count, std::size_t max_count,
                                        Range range) const {
  const auto& entry = node_->required(key);
  return node_->numbers(entry, entry.value, "", min_count, max_count, range);
}

std::vector<std::vector<double>> YamlReader::rows(std::string_view key, std::size_t row_count,
                                                  std::size_t column_count) const {
  const auto& entry = node_->required(key);
  if (!entry.value.IsSequence() || entry.value.size() != row_count) {
    node_->fail(entry, "must be a list of " + plural(row_count, "row") + " of " + plural(column_count, "number") +
                           ", got " + described(entry.value));
  }
  std::vector<std::vector<double>> rows;
  for (const auto& row : entry.value) {
    rows.push_back(
        node_->numbers(entry, row, "[" + std::to_string(rows.size()) + "]", column_count, column_count, any_number));
  }
  return rows;
}

std::vector<std::vector<double>> YamlReader::table(std::string_view key, std::size_t min_columns,
                                                   std::size_t max_columns) const {
  const auto& entry = node_->required(key);
  if (!entry.value.IsSequence() || entry.value.size() == 0) {
    node_->fail(entry, "must be a list of rows of numbers, got " + described(entry.value));
  }
  std::vector<std::vector<double>> rows;
  for (const auto& row : entry.value) {
    const std::size_t least = rows.empty() ? min_columns : rows.front().size();
    const std::size_t most = rows.empty() ? max_columns : rows.front().size();
    rows.push_back(node_->numbers(entry, row, "[" + std::to_string(rows.size()) + "]", least, most, any_number));
  }
  return rows;
}

std::vector<std::string> YamlReader::strings(std::string_view key) const {
  const auto& entry = node_->required(key);
  if (!entry.value.IsSequence()) {
    const bool is_word = !is_null(entry.value) && entry.value.IsScalar();
    node_->fail(entry, "must be a list of texts, got " + described(entry.value) +
                           (is_word ? ": write [" + printable(entry.value.Scalar()) + "]" : ""));
  }
  std::vector<std::string> strings;
  for (const auto& element : entry.value) {
    strings.push_back(node_->string(entry, element, "[" + std::to_string(strings.size()) + "]"));
  }
  return strings;
}

YamlReader YamlReader::map(std::string_view key) const {
  return YamlReader(node_->map(node_->required(key)));
}

std::optional<YamlReader> YamlReader::optional_map(std::string_view key) const {
  if (!has(key)) return std::nullopt;
  return map(key);
}

YamlReader YamlReader::map_or_empty(std::string_view key) const {
  if (has(key)) return map(key);
  const YAML::Node nothing(YAML::NodeType::Map);
  auto absent = std::make_shared<Node>(node_->file, node_->child(key), node_->line, nothing);
  absent->absent_from = node_;
  absent->absent_key = key;
  return YamlReader(std::move(absent));
}

std::vector<YamlReader> YamlReader::maps(std::string_view key) const {
  const auto& entry = node_->required(key);
  if (!entry.value.IsSequence()) node_->fail(entry, "must be a list of mappings, got " + described(entry.value));
  std::vector<YamlReader> readers;
  for (const auto& element : entry.value) {
    const int line = element.Mark().line + 1;
    readers.push_back(
        YamlReader(std::make_shared<Node>(entry.file, node_->child(key) + "[" + std::to_string(readers.size()) + "]",
                                          line > 0 ? line : entry.line, element)));
  }
  return readers;
}

std::vector<std::pair<std::string, YamlReader>> YamlReader::named_maps(std::string_view key) const {
  const YamlReader parent = map(key);
  std::vector<std::pair<std::string, YamlReader>> readers;
  for (const auto& entry : parent.node_->entries) {
    if (entry.is_removed) continue;
    readers.emplace_back(entry.key, YamlReader(parent.node_->map(entry)));
  }
  return readers;
}

std::vector<std::string> YamlReader::keys() const {
  std::vector<std::string> keys;
  for (const auto& entry : node_->entries)
    if (!entry.is_removed) keys.push_back(entry.key);
  return keys;
}

void YamlReader::finish(std::span<const KeyPath> elsewhere) const {
  for (const auto& entry : node_->entries) {
    if (node_->requested_keys.contains(entry.key)) continue;
    if (is_decimal_comma(entry.key)) node_->fail_at_decimal_comma(entry);
    if (const auto near = files::nearest_words(entry.key, node_->requested); !near.empty())
      node_->fail(entry, "is not a known key (did you mean " + one_of(near) + "?)");
    if (const auto near = of_other_places(entry.key, elsewhere); !near.empty())
      node_->fail(entry, "is not a known key here (did you mean " + one_of(near) + "?)");
    if (node_->requested.empty()) node_->fail(entry, "is not a known key");
    node_->fail(entry, fmt::format("is not a known key; known {}: {}", node_->path.empty() ? "are" : "here",
                                   fmt::join(node_->requested, ", ")));
  }
}

std::int64_t YamlReader::version(std::int64_t only, std::optional<std::int64_t> default_value) const {
  if (!has("version")) {
    if (default_value) return *default_value;
    const std::string misspelt = node_->misspelt("version");
    fail("",
         "version is missing" +
             (misspelt.empty() ? fmt::format(": write version: {}, the version of the file format", only) : misspelt));
  }
  const auto& entry = node_->required("version");
  const auto value = is_plain(entry.value) ? parse_integer(entry.value.Scalar()) : std::nullopt;
  if (value == only) return only;
  if (!is_null(entry.value) && entry.value.IsScalar() && parse_integer(entry.value.Scalar()) == only)
    node_->fail(entry, fmt::format("must be a whole number: write {}, without quotation marks", only));
  node_->fail(entry, "must be " + std::to_string(only) + ", got " + described(entry.value) +
                         ": it is the version of the file format, and this program reads only this one. It is neither "
                         "the program's version nor a count of your changes");
}

bool YamlReader::is_mapping(std::string_view key) const {
  return has(key) && node_->required(key).value.IsMap();
}

void YamlReader::fail(std::string_view key, const std::string& message) const {
  const auto entry = std::ranges::find(node_->entries, key, &Node::Entry::key);
  const std::string path = node_->child(key);
  const std::string text = path.empty() ? message : path + ": " + message;
  if (entry == node_->entries.end()) throw ConfigError(node_->file, node_->line, text);
  if (entry->patches.empty() || entry->file == entry->patches.back().file)
    throw ConfigError(entry->file, entry->line, text);
  const Node::Entry& over = entry->patches.back();  // either file may be at fault
  throw ConfigError(entry->file, entry->line,
                    text + " (" + over.file.string() + ":" + std::to_string(over.line) + " is read over it)");
}

const std::filesystem::path& YamlReader::path() const {
  return node_->file;
}
int YamlReader::line() const {
  return node_->line;
}

}  // namespace huetrack::yaml
