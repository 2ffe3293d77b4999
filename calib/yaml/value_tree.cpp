#include "calib/yaml/value_tree.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <sstream>

#include "calib/files/config_error.h"
#include "calib/yaml/hints.h"

namespace huetrack::yaml {
namespace {

// Builds the tree of one document.
class TreeBuilder : public YAML::EventHandler {
 public:
  explicit TreeBuilder(const std::filesystem::path& file) : file_(file) {}

  void OnDocumentStart(const YAML::Mark& mark) override { start_ = mark.pos; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { add(mark, Value::Kind::null); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    throw files::ConfigError(file_, mark.line + 1, "has a YAML alias (*), which is not read: write the value itself");
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t, const std::string& text) override {
    const bool is_null = tag == "?" && (text.empty() || text == "~" || text == "null" || text == "None");
    add(mark, is_null ? Value::Kind::null : Value::Kind::text, text);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    add(mark, Value::Kind::list);
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    add(mark, Value::Kind::map);
  }
  void OnMapEnd() override { open_.pop_back(); }

  int start() const { return start_; }
  Value take() { return std::move(root_); }

 private:
  // Keys arrive as values of their map, every second one.
  void add(const YAML::Mark& mark, Value::Kind kind, const std::string& text = {}) {
    Value value{.kind = kind, .text = text, .line = mark.line + 1};
    if (open_.empty()) {
      root_ = std::move(value);
      if (kind == Value::Kind::list || kind == Value::Kind::map) open_.push_back(&root_);
      return;
    }
    Value& parent = *open_.back();
    if (parent.kind == Value::Kind::map && parent.keys.size() == parent.items.size()) {
      if (kind == Value::Kind::list || kind == Value::Kind::map)
        throw files::ConfigError(file_, mark.line + 1, "has a list or a mapping as a key");
      parent.keys.push_back(text);
      key_line_ = mark.line + 1;
      return;
    }
    if (parent.kind == Value::Kind::map) value.line = key_line_;  // of a mapping, the mark is its first key's
    parent.items.push_back(std::move(value));
    if (kind == Value::Kind::list || kind == Value::Kind::map) open_.push_back(&parent.items.back());
  }

  const std::filesystem::path& file_;
  int start_ = -1, key_line_ = 0;
  Value root_;
  std::vector<Value*> open_;  // each the last item of the one before, which does not grow meanwhile
};

}  // namespace

const Value* Value::find(std::string_view key) const {
  const auto at = std::ranges::find(keys, key);
  return kind == Kind::map && at != keys.end() ? &items[static_cast<std::size_t>(at - keys.begin())] : nullptr;
}

std::vector<Value> values_of(std::string yaml, const std::filesystem::path& file) {
  if (yaml.starts_with("%YAML:")) std::fill_n(yaml.begin(), std::min(yaml.find('\n'), yaml.size()), ' ');
  std::vector<Value> documents;
  try {
    std::istringstream stream(yaml);
    YAML::Parser parser(stream);
    int last_start = -1;
    for (;;) {
      TreeBuilder builder(file);
      if (!parser.HandleNextDocument(builder)) break;
      // yaml-cpp does not get past a stray "," or "}" after a document (github.com/jbeder/yaml-cpp/pull/1319).
      if (builder.start() <= last_start) throw files::ConfigError(file, 0, "is not valid YAML");
      last_start = builder.start();
      Value document = builder.take();
      // After the last "---" of `ros2 topic echo`.
      if (document.kind != Value::Kind::null) documents.push_back(std::move(document));
    }
  } catch (const YAML::Exception& error) {
    const int line = error.mark.line + 1;
    const SyntaxHint hint = syntax_hint(yaml, line);
    throw files::ConfigError(file, hint.text.empty() ? line : hint.line,
                             "is not valid YAML or JSON: " + (hint.text.empty() ? error.msg : hint.text));
  }
  return documents;
}

}  // namespace huetrack::yaml
