// Photometric files: every type and symmetry becomes the same web, and what is wrong is named by its line.
#include "server/scene/import/photometric_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <numbers>
#include <sstream>

namespace radiosity::scene {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

Result<PhotometricFile> parse(const std::string& text) {
  return parsePhotometricFile({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "lamp.ies");
}

PhotometricFile parsed(const std::string& text) {
  auto file = parse(text);
  EXPECT_TRUE(file) << file.error().text();
  return file ? std::move(*file) : PhotometricFile{};
}

std::string photometricRefusal(const std::string& text) {
  const auto file = parse(text);
  EXPECT_FALSE(file);
  return file ? "" : file.error().text();
}

/// What an LM-63 file says after its head.
struct Ies {
  std::string version = "IESNA:LM-63-2002", tilt = "TILT=NONE", lumens = "-1", multiplier = "1", ballast = "1 1";
  int type = 1;
  std::vector<double> vertical{0, 45, 90}, horizontal{0};
  std::vector<double> candela{};  ///< empty: 100, 101, ... in the order of the file

  [[nodiscard]] std::string text() const {
    std::ostringstream out;
    out << version << "\r\n[TEST] none\r\n[MANUFAC] a, b\r\n"
        << tilt << "\r\n1 " << lumens << " " << multiplier << " " << vertical.size() << " " << horizontal.size() << " "
        << type << " 2 0 0 0\r\n"
        << ballast << " 40\r\n";
    for (const double angle : vertical) out << angle << " ";
    out << "\r\n";
    for (const double angle : horizontal) out << angle << ",";
    out << "\r\n";
    for (std::size_t i = 0; i < vertical.size() * horizontal.size(); ++i)
      out << (candela.empty() ? 100.0 + static_cast<double>(i) : candela[i]) << (i % 3 == 2 ? "\r\n" : " ");
    return out.str();
  }
};

float at(const PhotometricFile& file, double polar, double azimuth) {
  return webCandela(file.web.table, static_cast<float>(polar), static_cast<float>(azimuth));
}

TEST(Ies, AnglesBetweenThoseOfTheFileAreInterpolated) {
  Ies ies;
  ies.horizontal = {0, 90, 180, 270, 360};
  ies.candela = {10, 20, 30, 10, 40, 50, 10, 60, 70, 10, 80, 90, 10, 20, 30};
  const auto file = parsed(ies.text());
  EXPECT_FLOAT_EQ(at(file, 0, 0), 10);
  EXPECT_FLOAT_EQ(at(file, 22.5, 0), 15);
  EXPECT_FLOAT_EQ(at(file, 45, 45), 30);
  EXPECT_FLOAT_EQ(at(file, 67.5, -45), 0.25F * (80 + 90 + 20 + 30)) << "azimuths are the same after a full turn";
  EXPECT_FLOAT_EQ(at(file, 91, 0), 0) << "beyond the last angle it is dark";
  EXPECT_EQ(file.frame, WebFrame::kC);
  EXPECT_TRUE(file.warnings.empty());
}

TEST(Ies, TheLumensOfAWebAreItsIntegral) {
  Ies ies;
  ies.vertical = {0, 180};
  ies.candela = {5, 5};
  EXPECT_NEAR(parsed(ies.text()).web.lumens, 20.0 * pi, 1e-5);
  ies.vertical.clear();
  ies.candela.clear();
  ies.horizontal = {0, 90, 180, 270, 360};
  for (int i = 0; i <= 90; ++i) ies.vertical.push_back(i);
  for (int h = 0; h < 5; ++h)
    for (int i = 0; i <= 90; ++i) ies.candela.push_back(1000.0 * std::cos(i * pi / 180.0));
  EXPECT_NEAR(parsed(ies.text()).web.lumens, 1000.0 * pi, 0.2);
}

TEST(Ies, QuadrantsAndHalvesAreWrittenOut) {
  Ies quarter;
  quarter.horizontal = {0, 30, 90};
  Ies half;
  half.horizontal = {0, 30, 90, 150, 180};
  half.candela = {100, 101, 102, 103, 104, 105, 106, 107, 108, 103, 104, 105, 100, 101, 102};
  Ies old;  // LM-63-1995: from 90 to 270
  old.version = "IESNA:LM-63-1995";
  old.horizontal = {90, 150, 180, 210, 270};
  old.candela = {106, 107, 108, 103, 104, 105, 100, 101, 102, 103, 104, 105, 106, 107, 108};
  const auto a = parsed(quarter.text()), b = parsed(half.text()), c = parsed(old.text());
  for (const double azimuth : {-179.0, -150.0, -93.0, -20.0, 0.0, 14.0, 77.0, 90.0, 120.0, 171.0}) {
    for (const double polar : {0.0, 20.0, 88.0}) {
      EXPECT_NEAR(at(a, polar, azimuth), at(b, polar, azimuth), 1e-3) << azimuth;
      EXPECT_NEAR(at(a, polar, azimuth), at(c, polar, azimuth), 1e-3) << azimuth;
      EXPECT_NEAR(at(a, polar, azimuth), at(a, polar, -azimuth), 1e-3) << azimuth;
    }
  }
  EXPECT_NEAR(a.web.lumens, b.web.lumens, 1e-3);
  EXPECT_NEAR(a.web.lumens, c.web.lumens, 1e-3);
}

TEST(Ies, TypesAAndBLieOnTheirSides) {
  Ies ies;
  ies.vertical = {-90, 0, 90};
  ies.horizontal = {-90, 0, 90};
  // By horizontal angle, then vertical: 1, 2, 3; 4, 5, 6; 7, 8, 9.
  ies.candela = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  ies.type = 3;
  const auto a = parsed(ies.text());
  EXPECT_EQ(a.frame, WebFrame::kA);
  EXPECT_FLOAT_EQ(at(a, 90, 0), 5);   // straight on
  EXPECT_FLOAT_EQ(at(a, 0, 0), 6);    // along the axis: 90 degrees up
  EXPECT_FLOAT_EQ(at(a, 90, 90), 8);  // 90 degrees aside
  EXPECT_FLOAT_EQ(at(a, 90, 120), 0) << "behind it is dark";
  ies.type = 2;
  const auto b = parsed(ies.text());
  EXPECT_EQ(b.frame, WebFrame::kB);
  EXPECT_FLOAT_EQ(at(b, 90, 0), 5);
  EXPECT_FLOAT_EQ(at(b, 0, 0), 8);     // along the axis: 90 degrees aside
  EXPECT_FLOAT_EQ(at(b, 90, -90), 6);  // 90 degrees up
  ies.horizontal = {0, 90};
  ies.vertical = {0, 90};
  ies.candela = {5, 6, 8, 9};
  const auto mirrored = parsed(ies.text());
  EXPECT_THAT(mirrored.warnings, testing::ElementsAre(HasSubstr("vertical angles begin at 0")));
  EXPECT_FLOAT_EQ(at(mirrored, 90, 90), 6);
  EXPECT_FLOAT_EQ(at(mirrored, 90, -90), 6);
  EXPECT_FLOAT_EQ(at(mirrored, 180, 0), 8);
}

TEST(Ies, TypesAAndBThatEndBefore90AreDarkBeyond) {
  Ies ies;
  ies.type = 3;
  ies.vertical = {-30, 0, 30};
  ies.horizontal = {0, 40};
  ies.candela = {1, 2, 3, 4, 5, 6};
  const auto file = parsed(ies.text());
  EXPECT_THAT(file.warnings, testing::ElementsAre(HasSubstr("dark beyond them")));
  EXPECT_FLOAT_EQ(at(file, 90, 0), 2);
  EXPECT_FLOAT_EQ(at(file, 90, -40), 5);
  EXPECT_FLOAT_EQ(at(file, 60, 40), 6);
  EXPECT_FLOAT_EQ(at(file, 59, 0), 0);
  EXPECT_FLOAT_EQ(at(file, 90, 41), 0);
  ies.vertical = {10, 20, 30};
  EXPECT_THAT(photometricRefusal(ies.text()), HasSubstr("must begin at 0 or below and end above 0"));
}

TEST(Ies, MultiplierAndBallastCountAndTheSecondFactorOnlyBefore2002) {
  Ies ies;
  ies.multiplier = "2";
  ies.ballast = "0.5 3";
  ies.candela = {10, 20, 30};
  EXPECT_FLOAT_EQ(at(parsed(ies.text()), 0, 0), 10);
  ies.version = "IES:LM-63-2019";
  EXPECT_FLOAT_EQ(at(parsed(ies.text()), 0, 0), 10);
  for (const auto* version : {"IESNA:LM-63-1995", "IESNA91", "old lamp of 1986"}) {
    ies.version = version;
    EXPECT_FLOAT_EQ(at(parsed(ies.text()), 0, 0), 30) << version;
  }
}

TEST(Ies, MoreLumensThanTheLampsHaveIsSaid) {
  Ies ies;
  ies.vertical = {0, 180};
  ies.candela = {100, 100};  // 1257 lm
  ies.lumens = "1250";
  EXPECT_TRUE(parsed(ies.text()).warnings.empty());
  ies.lumens = "1000";
  EXPECT_THAT(parsed(ies.text()).warnings, testing::Contains(HasSubstr("1257 lm, more than the 1000 lm")));
  ies.lumens = "12000";  // a tenth: a luminaire may well swallow so much
  EXPECT_TRUE(parsed(ies.text()).warnings.empty());
  ies.lumens = "13000";
  EXPECT_THAT(parsed(ies.text()).warnings,
              testing::Contains(HasSubstr("1257 lm, less than a tenth of the 1.3e+04 lm of its lamps")));
  ies.lumens = "-1";
  EXPECT_TRUE(parsed(ies.text()).warnings.empty()) << "absolute photometry states no lumens";
}

TEST(Ies, TiltThatIsIncludedIsReadPast) {
  Ies ies;
  ies.tilt = "TILT=INCLUDE\r\n1\r\n3\r\n0 45 90\r\n1 0.9 0.8";
  const auto file = parsed(ies.text());
  EXPECT_FLOAT_EQ(at(file, 0, 0), 100);
  EXPECT_THAT(file.warnings, testing::Contains(HasSubstr("TILT")));
  ies.tilt = "TILT=lamp.tlt";
  const auto other = parse(ies.text());
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(other.error().text(), HasSubstr("line 4: TILT"));
}

TEST(Ies, WhatIsWrongIsNamedByItsLine) {
  const auto with = [](const auto& change) {
    Ies ies;
    change(ies);
    return ies.text();
  };
  EXPECT_THAT(photometricRefusal(with([](Ies& i) {
                i.vertical = {0, 90, 45};
              })),
              HasSubstr("line 7: vertical angles must ascend"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) {
                i.candela = {1, -2, 3};
              })),
              HasSubstr("line 9: candela is out of range"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) {
                i.horizontal = {0, 70};
              })),
              HasSubstr("horizontal angles must go from 0"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) { i.vertical = {0, 200}; })), HasSubstr("out of range"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) { i.multiplier = "nan"; })), HasSubstr("line 5: candela multiplier"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) { i.multiplier = "1e999"; })), HasSubstr("candela multiplier"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) { i.multiplier = "0"; })), HasSubstr("out of range"));
  EXPECT_THAT(photometricRefusal(with([](Ies& i) { i.type = 4; })), HasSubstr("photometric type is out of range"));
  auto text = Ies().text();
  EXPECT_THAT(photometricRefusal(text.substr(0, text.rfind("101"))), HasSubstr("the file ends before its candela"));
  EXPECT_THAT(photometricRefusal("IESNA:LM-63-2002\n[TEST]\n"), HasSubstr("without a line TILT="));
}

TEST(Ies, CountsAreBoundedBeforeAnythingIsMade) {
  const auto head = std::string("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 ");
  EXPECT_THAT(photometricRefusal(head + "1000000000 1 1 2 0 0 0 1 1 1\n"),
              HasSubstr("line 3: number of vertical angles"));
  EXPECT_THAT(photometricRefusal(head + "1000 100000 1 2 0 0 0 1 1 1\n"), HasSubstr("more than 262144 directions"));
  EXPECT_THAT(photometricRefusal(head + "2.5 1 1 2 0 0 0 1 1 1\n"), HasSubstr("whole number"));
  EXPECT_THAT(photometricRefusal(head + "-3 1 1 2 0 0 0 1 1 1\n"), HasSubstr("out of range"));
  EXPECT_THAT(photometricRefusal(std::string("\0\0\0", 3) + "x"), HasSubstr("no text"));
  EXPECT_THAT(photometricRefusal(""), HasSubstr("ends early"));
}

TEST(Ies, SymmetriesWrittenOutAreBoundedToo) {
  Ies ies;
  ies.vertical.clear();
  for (int i = 0; i <= 399; ++i) ies.vertical.push_back(180.0 * i / 399.0);
  ies.horizontal.clear();
  for (int i = 0; i <= 599; ++i) ies.horizontal.push_back(90.0 * i / 599.0);
  EXPECT_THAT(photometricRefusal(ies.text()), HasSubstr("symmetries written out, it has more than 262144 directions"));
}

TEST(Ies, ManyAzimuthsTakeTheTimeOfAsManyCandela) {
  Ies ies;
  ies.vertical = {0, 90};
  ies.horizontal.clear();
  for (int i = 0; i <= 9000; ++i) ies.horizontal.push_back(i / 100.0);
  const auto begin = std::clock();
  EXPECT_EQ(parsed(ies.text()).web.table[1], 36'001.0F);
  EXPECT_LT(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, 5.0) << "a square of them took 20 s";
}

TEST(Ies, AnglesThatAreTheSameDoNotAscend) {
  Ies ies;
  ies.vertical = {0, 45, 45.0005, 90};
  EXPECT_THAT(photometricRefusal(ies.text()), HasSubstr("vertical angles must ascend"));
}

/// A EULUMDAT file whose web is 1000 cos in cd / klm.
std::string eulumdat(int symmetry, int planes, double ratio = 100.0 * std::numbers::pi, const char* point = ".") {
  std::ostringstream out;
  out << "maker\n1\n" << symmetry << "\n" << planes << "\n" << 360.0 / planes << "\n19\n5\n";
  for (int i = 0; i < 14; ++i) out << "0\n";  // to the heights
  out << "100\n" << ratio << "\n1\n0\n1\n1\nLED\n2000\n3000\n80\n10\n";
  for (int i = 0; i < 10; ++i) out << "0\n";
  for (int i = 0; i < planes; ++i) out << 360.0 / planes * i << "\n";
  for (int i = 0; i < 19; ++i) out << 5 * i << "\n";
  const int told = symmetry == 1 ? 1 : symmetry == 4 ? planes / 4 + 1 : symmetry == 0 ? planes : planes / 2 + 1;
  for (int p = 0; p < told; ++p) {
    for (int i = 0; i < 19; ++i) {
      std::ostringstream number;
      number << 1000.0 * std::cos(5 * i * pi / 180.0) + (i == 9 && p == 0 ? 100.0 : 0.0);
      auto text = number.str();
      if (const auto dot = text.find('.'); dot != std::string::npos) text.replace(dot, 1, point);
      out << text << "\n";
    }
  }
  return out.str();
}

TEST(Eulumdat, CandelaAreForAThousandLumensOfItsLamps) {
  const auto file = parsed(eulumdat(1, 24));
  EXPECT_FLOAT_EQ(at(file, 0, 0), 2000);
  EXPECT_NEAR(at(file, 60, 123), 1000, 1e-2);
  EXPECT_NEAR(file.web.lumens, 2000.0 * pi, 0.03 * 2000.0 * pi);
  EXPECT_TRUE(file.warnings.empty()) << file.warnings.front();
  EXPECT_FLOAT_EQ(at(parsed(eulumdat(1, 24, 100.0, ",")), 0, 0), 2000) << "numbers may have commas";
  EXPECT_THAT(parsed(eulumdat(1, 24, 100.0)).warnings, testing::Contains(HasSubstr("say 2000 lm")));
}

TEST(Eulumdat, SymmetriesAreWrittenOutFromThePlaneThatTheyBeginAt) {
  // The first plane told has a bump: at C0, and for the plane C90-C270 at C270.
  const auto bump = [](const PhotometricFile& file, double azimuth) {
    return static_cast<double>(at(file, 45, azimuth)) - 2000.0 * std::cos(0.25 * pi);
  };
  for (const int symmetry : {0, 2, 4}) EXPECT_NEAR(bump(parsed(eulumdat(symmetry, 24)), 0), 200, 0.1) << symmetry;
  EXPECT_NEAR(bump(parsed(eulumdat(0, 24)), 180), 0, 0.1);
  EXPECT_NEAR(bump(parsed(eulumdat(2, 24)), 180), 0, 0.1);
  EXPECT_NEAR(bump(parsed(eulumdat(4, 24)), 180), 200, 0.1) << "symmetric to both planes";
  EXPECT_NEAR(bump(parsed(eulumdat(3, 24)), -90), 200, 0.1);
  EXPECT_NEAR(bump(parsed(eulumdat(3, 24)), 90), 0, 0.1);
  EXPECT_NEAR(bump(parsed(eulumdat(3, 24)), -170), 0, 0.1);
  EXPECT_NEAR(bump(parsed(eulumdat(0, 24)), -7.5), 100, 0.1) << "the circle is closed";
}

TEST(Eulumdat, WhatIsWrongIsNamedByItsLine) {
  const auto good = eulumdat(1, 24);
  EXPECT_THAT(photometricRefusal(good.substr(0, good.size() / 2)), HasSubstr("the file ends before"));
  EXPECT_THAT(photometricRefusal("a\n1\n7\n"), HasSubstr("line 3: symmetry indicator"));
  EXPECT_THAT(photometricRefusal("a\n1\n0\n100000\n1\n100000\n"), HasSubstr("line 6: more than 262144 directions"));
  EXPECT_THAT(photometricRefusal("a\n1\n4\n6\n60\n19\n"), HasSubstr("fourfold"));
}

}  // namespace
}  // namespace radiosity::scene
