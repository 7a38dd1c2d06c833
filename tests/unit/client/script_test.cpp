// The language of `radiosity script`.
#include <gmock/gmock.h>

#include "client/cli/script.h"

namespace radiosity::cli {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Every command as one text, "LINE: word|word".
std::vector<std::string> stepsOf(const std::string& text, bool first_only = false) {
  const auto script = Script::parse(text, "s");
  if (!script) return {script.error().text()};
  std::vector<std::string> steps;
  const auto done = script->run(first_only, [&](const ScriptStep& step) {
    std::string line = std::to_string(step.line) + ":";
    for (const auto& word : step.words) line += (line.back() == ':' ? " " : "|") + word;
    steps.push_back(line);
    return true;
  });
  if (!done) steps.push_back(done.error().text());
  return steps;
}

TEST(Script, wordsQuotesAndComments) {
  EXPECT_THAT(stepsOf("# nothing\n\n  set  @lamp.color\t1,0,0 # red\r\nprint 'a b' \"c # d\" e'f g'h #\nprint a#b"),
              ElementsAre("3: set|@lamp.color|1,0,0", "4: print|a b|c # d|ef gh", "5: print|a#b"));
}

TEST(Script, loopsCountListNestAndNumber) {
  EXPECT_THAT(stepsOf("for s from 5 to 20 count 4 index i\nset @a.b $s\nprint l-$i.png ${s}x $$\nend"),
              ElementsAre("2: set|@a.b|5", "3: print|l-0.png|5x|$", "2: set|@a.b|10", "3: print|l-1.png|10x|$",
                          "2: set|@a.b|15", "3: print|l-2.png|15x|$", "2: set|@a.b|20", "3: print|l-3.png|20x|$"));
  EXPECT_THAT(stepsOf("for a in x y\nfor b in $a 1\nprint $a$b\nend\nend\nprint z"),
              ElementsAre("3: print|xx", "3: print|x1", "3: print|yy", "3: print|y1", "6: print|z"));
  EXPECT_THAT(stepsOf("for t from 0 to 1 count 3\nprint $t\nend"),
              ElementsAre("2: print|0", "2: print|0.5", "2: print|1"));
  EXPECT_THAT(stepsOf("for t from 7 to 9 count 1\nprint $t\nend"), ElementsAre("2: print|7"));
  EXPECT_EQ(stepsOf("for t from 0 to 1 count 12 index i\nprint $i\nend").at(3), "2: print|03");
  EXPECT_THAT(stepsOf("for a in 1 2 3\nfor b in 4 5\nprint $a$b\nend\nend", true), ElementsAre("3: print|14"));
}

TEST(Script, faultsNameFileAndLine) {
  const auto fault = [](const std::string& text) { return stepsOf(text).back(); };
  EXPECT_THAT(fault("print a\nprint 'b"), HasSubstr("s:2: the quotation mark '"));
  EXPECT_THAT(fault("print $x"), HasSubstr("s:1: no loop around this sets $x"));
  EXPECT_THAT(fault("for x in 1\nprint $x\nend\nprint $x"), HasSubstr("s:4: no loop"));
  EXPECT_THAT(fault("print ${x"), HasSubstr("s:1: in \"${x\""));
  EXPECT_THAT(fault("print a$"), HasSubstr("s:1: in \"a$\""));
  EXPECT_THAT(fault("print a\n\nfor x in 1\nprint b"), HasSubstr("s:3: this loop has no \"end\""));
  EXPECT_THAT(fault("end"), HasSubstr("s:1: this \"end\" ends no loop"));
  EXPECT_THAT(fault("for x in 1\nend now"), HasSubstr("s:2: nothing may follow"));
  for (const auto* loop : {"for", "for x", "for x in", "for 1 in 2", "for x from 1 to 2", "for x from 1 to 2 count",
                           "for x of 1 2", "for x in 1 index 2y index 3"}) {
    EXPECT_THAT(fault(std::string(loop) + "\nend"), HasSubstr("s:1: a loop is written")) << loop;
  }
  for (const auto* loop : {"for x from a to 2 count 3", "for x from 1 to 2 count 0", "for x from 1 to 2 count 1.5",
                           "for x from 1 to 2 count 1e9", "for x from 1 to 2 count -1", "for x from 1 to 2 count nan",
                           "for x from nan to 2 count 3", "for x from 1 to inf count 3"}) {
    EXPECT_THAT(fault(std::string(loop) + "\nend"), HasSubstr("s:1: from, to and count")) << loop;
  }
  std::string deep;
  for (int i = 0; i < 17; ++i) deep += "for x in 1\n";
  EXPECT_THAT(fault(deep), HasSubstr("s:17: more than 16 loops"));
  EXPECT_THAT(fault(std::string(2 << 20, ' ')), HasSubstr("1 MiB"));
}

TEST(Script, endsEarlyWhenItIsTold) {
  const auto script = Script::parse("for x in 1 2 3\nprint $x\nend\nprint z", "s");
  int count = 0;
  EXPECT_TRUE(script->run(false, [&](const ScriptStep&) { return ++count < 2; }));
  EXPECT_EQ(count, 2);
}

}  // namespace
}  // namespace radiosity::cli
