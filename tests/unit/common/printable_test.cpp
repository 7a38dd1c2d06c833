#include "common/printable.h"

#include <gtest/gtest.h>

#include <string>

#include "common/one_line.h"

namespace radiosity {
namespace {

TEST(CharacterLength, isThatOfRfc3629) {
  EXPECT_EQ(characterLength("a"), 1U);
  EXPECT_EQ(characterLength("\xc3\xa9"), 2U);
  EXPECT_EQ(characterLength("\xe2\x82\xac"), 3U);
  EXPECT_EQ(characterLength("\xf0\x9f\x92\xa1"), 4U);
  EXPECT_EQ(characterLength(""), 0U);
  for (const auto* bad : {"\x80", "\xc3", "\xc0\xaf", "\xe0\x80\xaf", "\xed\xa0\x80", "\xe2\x82", "\xf4\x90\x80\x80",
                          "\xf5\x80\x80\x80", "\xff"})
    EXPECT_EQ(characterLength(bad), 0U) << printable(bad);
}

TEST(Printable, leavesTextAsItIs) {
  const std::string text = "tab\t back\\slash \xc3\xa9 \xe2\x82\xac \xf0\x9f\x92\xa1";
  EXPECT_EQ(printable(text), text);
}

TEST(Printable, escapesControlCharactersLineSeparatorsAndBytesThatAreNoUtf8) {
  EXPECT_EQ(printable(std::string("a\0b\r\n\x1b[31m\x7f", 11)), "a\\x00b\\x0d\\x0a\\x1b[31m\\x7f");
  EXPECT_EQ(printable("\xc2\x9b"
                      "2J \xc2\xa0"),
            "\\u009b2J \xc2\xa0");
  EXPECT_EQ(printable("\xe2\x80\xa8 \xe2\x80\xa9 \xe2\x80\xa6"), "\\u2028 \\u2029 \xe2\x80\xa6");
  EXPECT_EQ(printable("cut \xe2\x82"), "cut \\xe2\\x82");
  EXPECT_EQ(printable("\xed\xa0\x80 \xff"), "\\xed\\xa0\\x80 \\xff");
}

TEST(OneLine, hasNoBytesThatAreNoUtf8) {
  EXPECT_EQ(oneLine("r\xf6ll \xc3\xa9 \xc2"), "r?ll \xc3\xa9 ?");
  EXPECT_EQ(shortLine("\xed\xa0\x80 \xc3\xa9", 6), "??? \xc3\xa9");
}

}  // namespace
}  // namespace radiosity
