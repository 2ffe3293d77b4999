#include "calib/files/file_order.h"

#include <glob.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <map>
#include <numeric>
#include <ranges>
#include <set>

#include "calib/files/config_error.h"
#include "calib/files/median.h"

namespace huetrack::files {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view digits = "0123456789";

std::size_t end_of_number(std::string_view text, std::size_t from) {
  return std::min(text.find_first_not_of(digits, from), text.size());
}

bool is_digit(std::string_view text, std::size_t at) {
  return at < text.size() && digits.find(text[at]) != std::string_view::npos;
}

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// Digits after a point are a fraction in a UNIX time (nine digits: all times since 1973; programs drop trailing zeros),
// and in seconds, as in t0.133s.
bool is_fraction(std::string_view text, std::size_t at) {
  constexpr std::size_t digits_of_unix_time = 9;
  if (at < 2 || text[at - 1] != '.' || digits.find(text[at - 2]) == std::string_view::npos) return false;
  const std::size_t end = end_of_number(text, at);
  const bool is_in_seconds =
      end < text.size() && text[end] == 's' && (end + 1 == text.size() || !is_letter(text[end + 1]));
  if (is_in_seconds) return true;
  if (at < 1 + digits_of_unix_time) return false;
  return text.substr(at - 1 - digits_of_unix_time, digits_of_unix_time).find_first_not_of(digits) ==
         std::string_view::npos;
}

std::string_view without_extension(std::string_view path) {
  const std::size_t point = path.rfind('.'), name = path.rfind('/');
  const bool is_extension = point != std::string_view::npos && (name == std::string_view::npos || point > name) &&
                            point + 1 < path.size() && is_letter(path[point + 1]);
  return is_extension ? path.substr(0, point) : path;
}

// A + or - that may be a sign: a number follows, and none ends before it, as in 2026-11-28.
bool may_be_sign(std::string_view text, std::size_t at) {
  return (text[at] == '-' || text[at] == '+') && is_digit(text, at + 1) && (at == 0 || !is_digit(text, at - 1));
}

struct Number {
  bool is_negative = false;
  std::string_view whole = {};                    // without leading zeros
  std::optional<std::string_view> fraction = {};  // digits after the point
  std::size_t end = 0;

  double value() const {
    const std::string text = std::string(whole.empty() ? "0" : whole) + "." + std::string(fraction.value_or("0"));
    return (is_negative ? -1 : 1) * std::strtod(text.c_str(), nullptr);
  }
};

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

constexpr char no_point = 0;

// point: digits behind it are a fraction.
Number unsigned_number_at(std::string_view text, std::size_t at, char point = no_point) {
  Number number{.end = end_of_number(text, at)};
  number.whole = text.substr(at, number.end - at);
  number.whole.remove_prefix(std::min(number.whole.find_first_not_of('0'), number.whole.size()));
  if (number.end < text.size() && is_digit(text, number.end + 1) &&
      (lower(text[number.end]) == point || (text[number.end] == '.' && is_fraction(text, number.end + 1)))) {
    const std::size_t begin = number.end + 1;
    number.end = end_of_number(text, begin);
    number.fraction = text.substr(begin, number.end - begin);
  }
  return number;
}

// < 0: a comes first
int compare(const Number& a, const Number& b) {
  if (a.is_negative != b.is_negative) return a.is_negative ? -1 : 1;
  const int toward_later = a.is_negative ? -1 : 1;
  if (a.whole.size() != b.whole.size()) return a.whole.size() < b.whole.size() ? -toward_later : toward_later;
  if (const int c = a.whole.compare(b.whole); c != 0) return c < 0 ? -toward_later : toward_later;
  const int c = a.fraction.value_or("").compare(b.fraction.value_or(""));
  return c < 0 ? -toward_later : c > 0 ? toward_later : 0;
}

// The text between the numbers, which are #. Letters are small.
std::string skeleton_of(std::string_view text) {
  std::string skeleton;
  for (std::size_t at = 0; at < text.size(); ++at)
    if (!is_digit(text, at))
      skeleton += lower(text[at]);
    else if (!is_digit(text, at + 1))
      skeleton += '#';
  return skeleton;
}

constexpr std::string_view hexadecimal_digits = "0123456789abcdefABCDEF";

// What names differ in: all between their common beginning and end.
struct DifferingPart {
  std::size_t begin = 0, behind = 0;  // characters before and behind it
  // empty: the name has another beginning or end, or nothing between
  std::string_view of(std::string_view name) const {
    return name.size() > begin + behind ? name.substr(begin, name.size() - begin - behind) : std::string_view();
  }
};
DifferingPart differing_part(const std::vector<fs::path>& files) {
  const std::string_view first = without_extension(files.front().native());
  DifferingPart part{.begin = first.size(), .behind = first.size()};
  std::size_t shortest = first.size();
  for (const fs::path& file : files) {
    const std::string_view name = without_extension(file.native());
    const auto same = [](auto one, auto other) {
      return std::size_t(std::ranges::mismatch(one, other).in1 - std::ranges::begin(one));
    };
    shortest = std::min(shortest, name.size());
    part.begin = std::min(part.begin, same(first, name));
    part.behind = std::min(part.behind, same(std::views::reverse(first), std::views::reverse(name)));
  }
  while (part.begin > 0 && is_digit(first, part.begin - 1)) --part.begin;  // 1, 10, 11: the number begins before it
  part.behind = std::min(part.behind, shortest - std::min(shortest, part.begin));
  return part;
}

// Numbers that count in hexadecimal digits, by the files' names. Either most of the numbers between the least and the
// largest one occur, or the last digit takes most of its 16 values.
struct Hexadecimal {
  DifferingPart part;
  bool is_dense = false;
  std::uint64_t value(std::string_view name) const {
    return std::strtoull(std::string(part.of(name)).c_str(), nullptr, 16);
  }
};
std::optional<Hexadecimal> hexadecimal_numbers(const std::vector<fs::path>& files) {
  if (files.size() < 2) return std::nullopt;
  constexpr std::size_t longest = 16, most_last = 12, most_letters = 4;  // digits of 64 bits; of the 16 last ones
  Hexadecimal numbers{.part = differing_part(files)};
  std::set<char> last, last_letters;
  std::uint64_t least = ~std::uint64_t{0}, most = 0;
  for (const fs::path& file : files) {
    const std::string_view name = without_extension(file.native()), part = numbers.part.of(name);
    if (part.empty() || part.size() > longest || part.find_first_not_of(hexadecimal_digits) != std::string_view::npos)
      return std::nullopt;
    last.insert(lower(part.back()));
    if (is_letter(part.back())) last_letters.insert(lower(part.back()));
    least = std::min(least, numbers.value(name)), most = std::max(most, numbers.value(name));
  }
  numbers.is_dense = most - least < 2 * files.size();
  const bool takes_most = last.size() >= most_last && last_letters.size() >= most_letters;
  return !last_letters.empty() && (numbers.is_dense || takes_most) ? std::optional(numbers) : std::nullopt;
}

// As those of UUIDs and hashes.
bool most_differ_in_letters(const std::vector<fs::path>& files) {
  std::set<std::string> texts;
  for (const fs::path& file : files) {
    std::string text = skeleton_of(without_extension(file.native()));
    std::erase_if(text, [](char c) { return c == '-' || c == '+'; });  // may be signs
    texts.insert(std::move(text));
  }
  return 2 * texts.size() > files.size();
}

// How the names of one series are read.
class NameOrder {
 public:
  NameOrder() = default;
  // throws ConfigError: a "-" may be a sign or a separator
  explicit NameOrder(const std::vector<fs::path>& files) {
    find_signs(files);
    find_decimals(files);
    hexadecimal_ = hexadecimal_numbers(files);
  }

  bool operator()(std::string_view path_a, std::string_view path_b) const {
    std::string_view a = without_extension(path_a), b = without_extension(path_b);
    if (a == b) a = path_a, b = path_b;
    if (hexadecimal_)
      if (const auto x = hexadecimal_->value(a), y = hexadecimal_->value(b); x != y) return x < y;
    std::size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
      const auto x = number_at(a, i), y = number_at(b, j);
      if (!x || !y) {
        if (lower(a[i]) != lower(b[j])) return lower(a[i]) < lower(b[j]);
        ++i, ++j;
        continue;
      }
      if (const int c = compare(*x, *y); c != 0) return c < 0;
      i = x->end, j = y->end;
    }
    const std::size_t rest_a = a.size() - i, rest_b = b.size() - j;
    return rest_a != rest_b ? rest_a < rest_b : a < b;
  }

  std::optional<Number> number_at(std::string_view text, std::size_t at) const {
    if (is_digit(text, at))
      return unsigned_number_at(text, at, decimal_.empty() ? no_point : point_behind(skeleton_of(text.substr(0, at))));
    if (!may_be_sign(text, at) || signed_.empty()) return std::nullopt;
    const std::string before = skeleton_of(text.substr(0, at));
    if (!signed_.contains(before)) return std::nullopt;
    Number number = unsigned_number_at(text, at + 1, point_behind(before));
    number.is_negative = text[at] == '-';
    return number;
  }

  struct Parts {
    std::vector<double> numbers;
    std::string text;  // between them; each number is #; letters are small
  };
  // Of a path without its extension, from this place on.
  Parts parts_of(std::string_view path, std::size_t from = 0) const {
    Parts parts;
    for (std::size_t at = from; at < path.size(); ++at)
      if (const auto number = number_at(path, at)) {
        parts.numbers.push_back(number->value());
        parts.text += '#';
        at = number->end - 1;
      } else {
        parts.text += lower(path[at]);
      }
    return parts;
  }

  const std::optional<Hexadecimal>& hexadecimal() const { return hexadecimal_; }

 private:
  // Where numbers begin: visit(file, its name, place of the first digit, the number).
  template <typename Visit>
  static void visit_numbers(const std::vector<fs::path>& files, char point, Visit visit) {
    for (const fs::path& file : files) {
      const std::string_view name = without_extension(file.native());
      for (std::size_t at = 0; at < name.size(); ++at) {
        if (!is_digit(name, at)) continue;
        const Number number = unsigned_number_at(name, at, point);
        visit(file, name, at, number);
        at = number.end - 1;
      }
    }
  }

  // As a separator, every name has it: then none has the number directly behind the same text, or behind a +.
  void find_signs(const std::vector<fs::path>& files) {
    struct Seen {
      std::set<double> values;
      const fs::path* negative = nullptr;
      bool has_other = false;
    };
    std::map<std::string, Seen> places;  // by the text before the number
    visit_numbers(files, no_point, [&](const fs::path& file, std::string_view name, std::size_t at, Number number) {
      const auto note = [&](std::size_t begin) {
        Seen& seen = places[skeleton_of(name.substr(0, begin))];
        seen.values.insert(number.value());
        if (number.is_negative)
          seen.negative = &file;
        else
          seen.has_other = true;
      };
      note(at);
      if (at == 0 || !may_be_sign(name, at - 1)) return;
      number.is_negative = name[at - 1] == '-';
      note(at - 1);
    });
    for (const auto& [text, seen] : places) {
      if (seen.negative == nullptr || !seen.has_other) continue;
      if (!goes_on_across_zero(seen.values) && most_differ_in_letters(files)) return;
      if (!goes_on_across_zero(seen.values))
        throw ConfigError(*seen.negative, 0,
                          "has a - before its number, which other names do not have, and the numbers do not go on from "
                          "the negative to the positive ones: it may be a sign or a separator, so the order is not "
                          "known: rename the files, or give those of one kind only");
      signed_.insert(text);
    }
  }

  // Times as programs print them, without trailing zeros: 0.9, 0.9333, 1, 1.0333. As fractions the numbers at one place
  // are all different and go on in even steps; parts and counters, as in 1.9, 1.10, do not.
  // A comma, _, - or p in the place of the point separates numbers as well: only where names drop the fraction's zeros
  // do the readings differ.
  void find_decimals(const std::vector<fs::path>& files) {
    for (const char point : std::string_view(".,_-p")) {
      struct Seen {
        std::vector<double> values;
        std::set<std::size_t> digits;  // of the fractions
      };
      std::map<std::string, Seen> places;  // by the text before the number
      visit_numbers(files, point, [&](const fs::path&, std::string_view name, std::size_t at, Number number) {
        std::string text = skeleton_of(name.substr(0, at));
        if (at > 0 && may_be_sign(name, at - 1))
          if (std::string before = skeleton_of(name.substr(0, at - 1)); signed_.contains(before)) {
            number.is_negative = name[at - 1] == '-';
            text = std::move(before);
          }
        Seen& seen = places[text];
        seen.values.push_back(number.value());
        if (number.fraction) seen.digits.insert(number.fraction->size());
      });
      for (auto& [text, seen] : places)
        if (seen.digits.size() >= (point == '.' ? 1 : 2) && seen.values.size() == files.size() && are_even(seen.values))
          decimal_.try_emplace(text, point);
    }
  }
  char point_behind(const std::string& text) const {
    const auto point = decimal_.find(text);
    return point == decimal_.end() ? no_point : point->second;
  }

  static bool are_even(std::vector<double>& values) {
    std::ranges::sort(values);
    std::vector<double> steps;
    for (std::size_t i = 1; i < values.size(); ++i) steps.push_back(values[i] - values[i - 1]);
    constexpr std::size_t least_steps = 3;  // v1.9 and v1.10 are as far apart as any two
    if (steps.size() < least_steps) return false;
    const auto [least, most] = std::ranges::minmax(steps);
    return least > 0 && most < 2 * least;  // between two numbers there is no place for another
  }

  // No number has its place between the last negative one and the first that is not.
  static bool goes_on_across_zero(const std::set<double>& values) {
    std::vector<double> steps;
    double across = 0;
    for (auto before = values.begin(), value = std::next(before); value != values.end(); before = value++)
      (*before < 0 && *value >= 0 ? across : steps.emplace_back()) = *value - *before;
    return steps.empty() || across < 2 * median(std::move(steps));
  }

  std::set<std::string> signed_;         // texts before a number with a sign
  std::map<std::string, char> decimal_;  // texts before a number with a fraction, and its point
  std::optional<Hexadecimal> hexadecimal_;
};

// Of each name, those of its numbers that are not the same in all. Empty: the names are not of one kind.
std::vector<std::vector<double>> numbers_that_vary(const std::vector<fs::path>& files) {
  const NameOrder order(files);
  std::vector<std::vector<double>> numbers;
  std::set<std::string> kinds;
  for (const fs::path& file : files) {
    NameOrder::Parts parts = order.parts_of(without_extension(file.native()));
    numbers.push_back(std::move(parts.numbers));
    kinds.insert(std::move(parts.text));
  }
  if (kinds.size() != 1 || order.hexadecimal()) return {};
  for (std::size_t place = numbers.front().size(); place-- > 0;)
    if (std::ranges::all_of(numbers, [&](const auto& of) { return of[place] == numbers.front()[place]; }))
      for (auto& of : numbers) of.erase(of.begin() + static_cast<std::ptrdiff_t>(place));
  return numbers;
}

// The numbers of names with one of these texts, in the order of the names: how far one is from the one before it, at
// most. nullopt: they do not ascend.
std::optional<double> longest_step(const std::vector<NameOrder::Parts>& names, const std::set<std::string>& texts) {
  const std::vector<double>* before = nullptr;
  double longest = 0;
  for (const NameOrder::Parts& name : names) {
    if (!texts.contains(name.text)) continue;
    const auto& numbers = name.numbers;
    if (before != nullptr && (before->size() != numbers.size() || !(*before < numbers))) return std::nullopt;
    if (before != nullptr && std::equal(numbers.begin(), numbers.end() - 1, before->begin()))
      longest = std::max(longest, numbers.back() - before->back());
    before = &numbers;
  }
  return longest;
}

// Files of another text count on in a series, as where it goes on under another name, or in its gaps (img_7_blur): with
// them it has no longer steps. A single one at its beginning or end does so by chance (bg0.jpg).
bool counts_on(const std::vector<NameOrder::Parts>& names, const std::string& series, const std::string& text,
               bool is_single) {
  const auto alone = longest_step(names, {series}), together = longest_step(names, {series, text});
  if (!alone || !together || *together > *alone) return false;
  std::vector<std::string> order;
  for (const NameOrder::Parts& name : names)
    if (name.text == series || name.text == text) order.push_back(name.text);
  return !is_single || (order.front() == series && order.back() == series);
}

constexpr std::size_t least_random_steps = 30;

// Counters and times go on in steps that are mostly alike; between random numbers steps are of all lengths: 28 % of
// them are within a factor of 1.5 of the median.
bool are_random(std::vector<double> values) {
  constexpr double alike = 1.5, least_share = 0.4;
  std::ranges::sort(values);
  std::vector<double> steps;
  for (std::size_t i = 1; i < values.size(); ++i) steps.push_back(values[i] - values[i - 1]);
  if (steps.size() < least_random_steps) return false;
  std::ranges::sort(steps);
  const double median = steps[steps.size() / 2];
  const auto count =
      std::ranges::count_if(steps, [&](double step) { return step * alike >= median && step <= alike * median; });
  return static_cast<double>(count) < least_share * static_cast<double>(steps.size());
}

}  // namespace

bool numbers_ascend(std::string_view path_a, std::string_view path_b) {
  return NameOrder()(path_a, path_b);
}

void sort_by_numbers(std::vector<fs::path>& files) {
  const NameOrder order(files);
  std::ranges::sort(files, [&](const fs::path& a, const fs::path& b) { return order(a.native(), b.native()); });
}

std::vector<double> last_numbers(const std::vector<fs::path>& files) {
  const NameOrder order(files);
  std::vector<double> numbers;
  for (const fs::path& file : files) {
    const std::string_view path = without_extension(file.native());
    if (order.hexadecimal()) {
      numbers.push_back(static_cast<double>(order.hexadecimal()->value(path)));
      continue;
    }
    const NameOrder::Parts name = order.parts_of(path, path.rfind('/') + 1);  // npos + 1 is 0
    if (name.numbers.empty()) return {};
    numbers.push_back(name.numbers.back());
  }
  return numbers;
}

std::vector<std::vector<std::size_t>> other_orders(const std::vector<fs::path>& files) {
  const auto numbers = numbers_that_vary(files);
  const std::size_t count = numbers.empty() ? 0 : numbers.front().size();
  if (count < 2) return {};
  std::vector<std::vector<std::size_t>> leading;  // places of numbers, the leading one first
  std::vector<std::size_t> places(count);
  std::iota(places.begin(), places.end(), 0);
  constexpr std::size_t most_tried = 3;  // all orders of so many: six
  const std::vector<std::size_t> as_played = places;
  if (count <= most_tried)
    while (std::ranges::next_permutation(places).found) leading.push_back(places);
  else
    for (std::size_t first = 1; first < count; ++first) {
      leading.push_back(as_played);
      std::rotate(leading.back().begin(), leading.back().begin() + static_cast<std::ptrdiff_t>(first),
                  leading.back().begin() + static_cast<std::ptrdiff_t>(first) + 1);
    }
  std::set<std::vector<std::size_t>> orders;
  for (const auto& by : leading) {
    std::vector<std::size_t> order(files.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
      for (const std::size_t place : by)
        if (numbers[a][place] != numbers[b][place]) return numbers[a][place] < numbers[b][place];
      return false;
    });
    if (!std::ranges::is_sorted(order)) orders.insert(std::move(order));
  }
  return {orders.begin(), orders.end()};
}

std::vector<fs::path> several_series(const std::vector<fs::path>& files) {
  const NameOrder order(files);
  if (order.hexadecimal()) return {};
  struct Series {
    const fs::path* first;
    std::set<std::vector<double>> numbers;
  };
  std::map<std::string, Series> by_text;
  for (const fs::path& file : files) {
    NameOrder::Parts parts = order.parts_of(without_extension(file.native()));
    // img1.jpg and img1.png, or IMG1.JPG, are two.
    std::string letters = file.native();
    std::erase_if(letters, [](char c) { return !is_letter(c); });
    by_text.try_emplace(parts.text + letters, Series{&file, {}}).first->second.numbers.insert(std::move(parts.numbers));
  }
  std::vector<const Series*> largest;
  for (const auto& [text, series] : by_text) largest.push_back(&series);
  std::ranges::stable_sort(largest, std::greater(), [](const Series* series) { return series->numbers.size(); });
  if (largest.size() < 2) return {};
  // A series that goes on under another name, as after a change of cards, counts on.
  const auto &first = largest[0]->numbers, &second = largest[1]->numbers;
  const auto both = std::ranges::count_if(second, [&](const auto& numbers) { return first.contains(numbers); });
  constexpr std::ptrdiff_t of_a_series = 2;  // a single file may be a note, a copy
  if (both < of_a_series || 2 * std::size_t(both) < second.size()) return {};
  return {*largest[0]->first, *largest[1]->first};
}

std::vector<fs::path> stray_files(const std::vector<fs::path>& files) {
  const NameOrder order(files);
  if (order.hexadecimal()) return {};
  std::vector<NameOrder::Parts> names;
  std::map<std::string, std::size_t> named_so;
  for (const fs::path& file : files)
    ++named_so[names.emplace_back(order.parts_of(without_extension(file.native()))).text];
  const auto series = std::ranges::max_element(named_so, {}, [](const auto& kind) { return kind.second; });
  constexpr std::size_t of_a_series = 3;  // two other names are no series that one can be a stray of
  if (series == named_so.end() || series->second < of_a_series || 2 * series->second <= files.size()) return {};
  std::set<std::string> others;
  for (const auto& [text, count] : named_so)
    if (text != series->first && !counts_on(names, series->first, text, count == 1)) others.insert(text);
  std::vector<fs::path> strays;
  for (std::size_t k = 0; k < files.size(); ++k)
    if (others.contains(names[k].text)) strays.push_back(files[k]);
  return strays;
}

bool hold_an_order(const std::vector<fs::path>& files) {
  const NameOrder order(files);
  if (files.size() < 3 || (order.hexadecimal() && order.hexadecimal()->is_dense)) return true;
  if (order.hexadecimal() && files.size() > least_random_steps) return !are_random(last_numbers(files));
  if (const auto numbers = numbers_that_vary(files); !numbers.empty() && numbers.front().size() == 1) {
    std::vector<double> values;
    for (const auto& of_file : numbers) values.push_back(of_file.front());
    if (are_random(values)) return false;
  }
  const std::string_view first = without_extension(files.front().native());
  std::string common = skeleton_of(first);
  for (const fs::path& file : files) {
    const std::string skeleton = skeleton_of(without_extension(file.native()));
    common.resize(static_cast<std::size_t>(std::ranges::mismatch(common, skeleton).in1 - common.begin()));
  }
  std::set<std::vector<double>> places;  // by the numbers in the text that all have
  for (const fs::path& file : files) {
    const std::string_view name = without_extension(file.native());
    std::vector<double> numbers;
    for (std::size_t at = 0, count = std::size_t(std::ranges::count(common, '#')); numbers.size() < count; ++at)
      if (is_digit(name, at)) {
        const std::size_t end = end_of_number(name, at);
        numbers.push_back(std::strtod(std::string(name.substr(at, end - at)).c_str(), nullptr));
        at = end;
      }
    places.insert(std::move(numbers));
  }
  return !most_differ_in_letters(files) || 2 * places.size() > files.size();
}

std::vector<fs::path> letters_in_numbers(const std::vector<fs::path>& files) {
  if (files.size() < 2 || hexadecimal_numbers(files)) return {};
  const DifferingPart differing = differing_part(files);
  const fs::path *digits_only = nullptr, *with_letter = nullptr;
  for (const fs::path& file : files) {
    const std::string_view part = differing.of(without_extension(file.native()));
    if (part.empty() || part.find_first_not_of(hexadecimal_digits) != std::string_view::npos) return {};
    const std::size_t letter = part.find_first_not_of(digits);
    if (letter == std::string_view::npos) digits_only = &file;
    if (letter < part.find_last_of(digits) && part.find_last_of(digits) != std::string_view::npos) with_letter = &file;
  }
  return digits_only && with_letter ? std::vector{*digits_only, *with_letter} : std::vector<fs::path>{};
}

std::optional<fs::path> hexadecimal_left_out(const std::vector<fs::path>& files, std::vector<fs::path> all) {
  if (files.size() < 2 || hexadecimal_numbers(files)) return std::nullopt;
  const DifferingPart differing = differing_part(files);
  const std::string_view first = without_extension(files.front().native());
  std::erase_if(all, [&](const fs::path& file) {
    const std::string_view name = without_extension(file.native()), part = differing.of(name);
    return part.empty() || part.find_first_not_of(hexadecimal_digits) != std::string_view::npos ||
           !name.starts_with(first.substr(0, differing.begin)) ||
           !name.ends_with(first.substr(first.size() - differing.behind));
  });
  if (all.size() <= files.size() || !hexadecimal_numbers(all)) return std::nullopt;
  return *std::ranges::find_if(all, [&](const fs::path& file) { return std::ranges::count(files, file) == 0; });
}

std::vector<fs::path> files_of_glob(const std::string& pattern) {
  std::vector<fs::path> found;
  glob_t matches{};
  if (::glob(pattern.c_str(), 0, nullptr, &matches) == 0)
    found.assign(matches.gl_pathv, matches.gl_pathv + matches.gl_pathc);
  ::globfree(&matches);
  sort_by_numbers(found);
  return found;
}

}  // namespace huetrack::files
