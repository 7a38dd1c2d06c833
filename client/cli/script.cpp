#include "client/cli/script.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>

namespace radiosity::cli {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 20;
constexpr std::size_t kMaxLoops = 16;
constexpr std::size_t kMaxCount = 1'000'000;

using Variables = std::map<std::string, std::string>;

bool isNameCharacter(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

bool isName(const std::string& text) {
  return !text.empty() && std::isdigit(static_cast<unsigned char>(text[0])) == 0 &&
         std::all_of(text.begin(), text.end(), isNameCharacter);
}

/// Words are set apart by blanks; "..." and '...' hold blanks, # starts a comment where a word could start. An error
/// is the text.
std::optional<std::string> splitWords(const std::string& line, std::vector<std::string>& words) {
  for (std::size_t i = 0; i < line.size();) {
    if (std::isspace(static_cast<unsigned char>(line[i])) != 0) {
      ++i;
      continue;
    }
    if (line[i] == '#') break;
    std::string word;
    while (i < line.size() && std::isspace(static_cast<unsigned char>(line[i])) == 0) {
      if (line[i] != '"' && line[i] != '\'') {
        word += line[i++];
        continue;
      }
      const auto end = line.find(line[i], i + 1);
      if (end == std::string::npos) return fmt::format("the quotation mark {} is not closed", line[i]);
      word += line.substr(i + 1, end - i - 1);
      i = end + 1;
    }
    words.push_back(std::move(word));
  }
  return std::nullopt;
}

/// $name and ${name}; $$ is a dollar sign. An error is the text.
std::optional<std::string> putIn(const Variables& variables, std::string& word) {
  std::string out;
  for (std::size_t i = 0; i < word.size(); ++i) {
    if (word[i] != '$') {
      out += word[i];
      continue;
    }
    const bool braces = i + 1 < word.size() && word[i + 1] == '{';
    const auto begin = i + (braces ? 2 : 1);
    auto end = begin;
    while (end < word.size() && isNameCharacter(word[end])) ++end;
    if (!braces && end == begin && begin < word.size() && word[begin] == '$') {
      out += '$';
      i = begin;
      continue;
    }
    const auto name = word.substr(begin, end - begin);
    if (name.empty() || (braces && (end == word.size() || word[end] != '}')))
      return fmt::format("in \"{}\": a variable is written $name or ${{name}}, a dollar sign $$", word);
    const auto found = variables.find(name);
    if (found == variables.end()) return fmt::format("no loop around this sets ${}", name);
    out += found->second;
    i = braces ? end : end - 1;
  }
  word = std::move(out);
  return std::nullopt;
}

std::optional<double> numberIn(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;  // "nan"
  return value;
}

/// What a `for` line says, with variables put in.
struct Loop {
  std::string variable, index;
  std::vector<std::string> values;
};

/// for NAME in VALUE... | for NAME from A to B count N; either may end in: index NAME. An error is the text.
std::optional<std::string> readLoop(std::vector<std::string> words, Loop& loop) {
  const std::string usage =
      "a loop is written: for NAME in VALUE... [index NAME], or: for NAME from A to B count N [index NAME]";
  if (words.size() < 4 || !isName(words[1])) return usage;
  loop.variable = words[1];
  if (words.size() > 5 && words[words.size() - 2] == "index") {
    loop.index = words.back();
    if (!isName(loop.index)) return usage;
    words.resize(words.size() - 2);
  }
  if (words[2] == "in") {
    loop.values.assign(words.begin() + 3, words.end());
    return std::nullopt;
  }
  if (words.size() != 8 || words[2] != "from" || words[4] != "to" || words[6] != "count") return usage;
  const auto from = numberIn(words[3]), to = numberIn(words[5]), count = numberIn(words[7]);
  if (!from || !to || !count || *count < 1 || *count > static_cast<double>(kMaxCount) ||
      *count != static_cast<double>(static_cast<std::size_t>(*count)))
    return "from, to and count are numbers, and the count is a whole one from 1 to 1000000";
  const auto steps = static_cast<std::size_t>(*count);
  for (std::size_t i = 0; i < steps; ++i) {
    const double share = steps > 1 ? static_cast<double>(i) / static_cast<double>(steps - 1) : 0.0;
    loop.values.push_back(fmt::format("{:.9g}", *from + share * (*to - *from)));
  }
  return std::nullopt;
}

/// Runs lines with the variables of the loops around them.
class Runner {
 public:
  Runner(const Script& script, const std::vector<ScriptLine>& lines, bool first_only,
         const std::function<bool(const ScriptStep&)>& visit)
      : script_(script), lines_(lines), first_only_(first_only), visit_(visit) {}

  /// Lines [begin, end); false: ended early.
  Result<bool> run(std::size_t begin, std::size_t end) {
    for (auto at = begin; at < end; ++at) {
      ScriptStep step{lines_[at].number, lines_[at].words};
      for (auto& word : step.words) {
        if (const auto fault = putIn(variables_, word)) return bad(step.line, *fault);
      }
      if (step.words[0] != "for") {
        if (!visit_(step)) return false;
        continue;
      }
      const auto close = endOf(at);
      const auto goes_on = loop(step, at + 1, close);
      if (!goes_on || !*goes_on) return goes_on;
      at = close;
    }
    return true;
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(int line, std::string what) const {
    return fail(ErrorCode::kBadInput, std::move(what), script_.place(line));
  }

  Result<bool> loop(const ScriptStep& step, std::size_t begin, std::size_t end) {
    Loop loop;
    if (const auto fault = readLoop(step.words, loop)) return bad(step.line, *fault);
    const auto outer = variables_;
    const auto digits = std::to_string(loop.values.size() - 1).size();
    for (std::size_t i = 0; i < loop.values.size(); ++i) {
      variables_[loop.variable] = loop.values[i];
      if (!loop.index.empty()) variables_[loop.index] = fmt::format("{:0{}}", i, digits);
      const auto goes_on = run(begin, end);
      if (!goes_on || !*goes_on) return goes_on;
      if (first_only_) break;
    }
    variables_ = outer;
    return true;
  }

  /// The `end` of the loop that begins at `at`; checkLoops has seen that there is one.
  [[nodiscard]] std::size_t endOf(std::size_t at) const {
    for (int depth = 0;; ++at) {
      if (lines_[at].words[0] == "for") ++depth;
      if (lines_[at].words[0] == "end" && --depth == 0) return at;
    }
  }

  const Script& script_;
  const std::vector<ScriptLine>& lines_;
  bool first_only_;
  const std::function<bool(const ScriptStep&)>& visit_;
  Variables variables_;
};

}  // namespace

Result<Script> Script::parse(const std::string& text, std::string name) {
  Script script;
  script.name_ = std::move(name);
  if (text.size() > kMaxBytes) return fail(ErrorCode::kTooLarge, "a script may have 1 MiB", script.name_);
  int number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const auto end = std::min(text.find('\n', begin), text.size());
    ScriptLine line{++number, {}};
    if (const auto fault = splitWords(text.substr(begin, end - begin), line.words))
      return fail(ErrorCode::kBadInput, *fault, script.place(number));
    if (!line.words.empty()) script.lines_.push_back(std::move(line));
    begin = end + 1;
  }
  if (auto ok = script.checkLoops(); !ok) return tl::unexpected(ok.error());
  return script;
}

Result<void> Script::checkLoops() const {
  std::vector<int> open;
  for (const auto& line : lines_) {
    if (line.words[0] == "for") open.push_back(line.number);
    if (open.size() > kMaxLoops)
      return fail(ErrorCode::kTooLarge, "more than 16 loops inside each other", place(line.number));
    if (line.words[0] != "end") continue;
    if (line.words.size() > 1) return fail(ErrorCode::kBadInput, "nothing may follow \"end\"", place(line.number));
    if (open.empty()) return fail(ErrorCode::kBadInput, "this \"end\" ends no loop", place(line.number));
    open.pop_back();
  }
  if (!open.empty()) return fail(ErrorCode::kBadInput, "this loop has no \"end\"", place(open.back()));
  return {};
}

Result<void> Script::run(bool first_only, const std::function<bool(const ScriptStep&)>& visit) const {
  const auto done = Runner(*this, lines_, first_only, visit).run(0, lines_.size());
  if (!done) return tl::unexpected(done.error());
  return {};
}

}  // namespace radiosity::cli
