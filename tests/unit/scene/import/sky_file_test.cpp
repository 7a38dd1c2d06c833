// Pictures of skies: both formats read, and what is broken, hostile or enormous refused with a reason.
#include "server/scene/import/sky_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfPreviewImage.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace radiosity::scene {
namespace {

using testing::HasSubstr;

Result<SkyImage> read(const std::string& bytes) {
  return readSkyFile({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "sky.hdr");
}

std::string skyRefusal(const std::string& bytes) {
  const auto image = read(bytes);
  EXPECT_FALSE(image);
  return image ? "" : image.error().text();
}

std::string hdr(const std::string& size, const std::string& pixels, const std::string& more = "") {
  return "#?RADIANCE\n" + more + "FORMAT=32-bit_rle_rgbe\n\n" + size + "\n" + pixels;
}

class Buffer : public Imf::OStream {
 public:
  Buffer() : Imf::OStream("buffer") {}
  void write(const char from[], int count) override {
    bytes.resize(std::max(bytes.size(), at + static_cast<std::size_t>(count)));
    std::memcpy(bytes.data() + at, from, static_cast<std::size_t>(count));
    at += static_cast<std::size_t>(count);
  }
  std::uint64_t tellp() override { return at; }
  void seekp(std::uint64_t to) override { at = to; }
  std::string bytes;
  std::size_t at = 0;
};

/// One colour, but for the first pixel; a data window that begins elsewhere.
std::string exr(int width, int height, float first, Imf::Compression compression = Imf::ZIP_COMPRESSION,
                const std::vector<std::string>& channels = {"R", "G", "B"}, bool has_preview = false) {
  const Imath::Box2i window(Imath::V2i(-3, 5), Imath::V2i(width - 4, height + 4));
  Imf::Header header(window, window);
  header.compression() = compression;
  if (has_preview) header.setPreviewImage(Imf::PreviewImage(2, 2));
  std::vector<float> pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 2.0F);
  pixels[0] = first;
  Imf::FrameBuffer buffer;
  for (const auto& channel : channels) {
    header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    auto* base = reinterpret_cast<char*>(pixels.data()) - 4 * (window.min.x + std::ptrdiff_t{window.min.y} * width);
    buffer.insert(channel, Imf::Slice(Imf::FLOAT, base, 4, 4 * static_cast<std::size_t>(width)));
  }
  Buffer to;
  {
    Imf::OutputFile file(to, header);
    file.setFrameBuffer(buffer);
    file.writePixels(height);
  }
  return to.bytes;
}

TEST(HdrFile, IsReadFlatAndPacked) {
  const std::string pixel("\x80\x40\x20\x81", 4);  // 1, 0.5, 0.25
  const auto flat = read(hdr("-Y 1 +X 2", pixel + pixel));
  ASSERT_TRUE(flat) << flat.error().text();
  EXPECT_EQ(flat->width, 2U);
  const auto colour = glm::vec3(1.0F, 0.5F, 0.25F);
  EXPECT_EQ(flat->texels[1], colour);
  const auto repeated = read(hdr("-Y 1 +X 3", pixel + std::string("\x01\x01\x01\x02", 4)));
  ASSERT_TRUE(repeated) << repeated.error().text();
  EXPECT_EQ(repeated->texels[2], colour);
  std::string row("\x02\x02\x00\x08", 4);
  for (const char value : {'\x80', '\x40', '\x20'}) row += std::string("\x88", 1) + value;
  row += std::string("\x08\x81\x81\x81\x81\x81\x81\x81\x82", 9);
  const auto packed = read(hdr("-Y 2 +X 8", row + row, "EXPOSURE=2\n# made by hand\n"));
  ASSERT_TRUE(packed) << packed.error().text();
  EXPECT_EQ(packed->texels[9], 0.5F * colour) << "what the exposure multiplied is divided by it";
  EXPECT_EQ(packed->texels[15], colour);
  const auto corrected = read(hdr("-Y 1 +X 1", pixel, "COLORCORR= 1 2 0.5\n"));
  ASSERT_TRUE(corrected) << corrected.error().text();
  EXPECT_EQ(corrected->texels[0], colour / glm::vec3(1.0F, 2.0F, 0.5F));
}

TEST(HdrFile, IsRefusedWithAReason) {
  const std::string pixel("\x80\x40\x20\x81", 4);
  EXPECT_THAT(skyRefusal(""), HasSubstr("sky.hdr: is neither"));
  EXPECT_THAT(skyRefusal("#?RADIANCE\n"), HasSubstr("header has no end"));
  EXPECT_THAT(skyRefusal("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n" + pixel), HasSubstr("xyze"));
  EXPECT_THAT(skyRefusal(hdr("+Y 1 +X 1", pixel)), HasSubstr("-Y rows +X columns"));
  EXPECT_THAT(skyRefusal(hdr("-Y 1 +X x", pixel)), HasSubstr("no two numbers"));
  EXPECT_THAT(skyRefusal(hdr("-Y 0 +X 4", pixel)), HasSubstr("no pixels"));
  EXPECT_THAT(skyRefusal(hdr("-Y 2 +X 1", pixel)), HasSubstr("row 1 of 2"));
  EXPECT_THAT(skyRefusal(hdr("-Y 1 +X 8", std::string("\x02\x02\x00\x08\x89\x01", 6))), HasSubstr("row 0"));
  EXPECT_THAT(skyRefusal(hdr("-Y 1 +X 1", std::string("\x80\x40\x20\xFF", 4))), HasSubstr("pixel (0, 0)"));
  EXPECT_THAT(skyRefusal(hdr("-Y 1 +X 1", pixel, "EXPOSURE=0\n")), HasSubstr("EXPOSURE must be a number"));
  EXPECT_THAT(skyRefusal(hdr("-Y 1 +X 1", pixel, "COLORCORR=1 2\n")), HasSubstr("COLORCORR must be three"));
  // Four gigabytes, decoded, in a hundred bytes; and what would wrap round.
  EXPECT_THAT(skyRefusal(hdr("-Y 16384 +X 16384", pixel)), HasSubstr("16384 x 16384 pixels"));
  EXPECT_THAT(skyRefusal(hdr("-Y 18446744073709551615 +X 18446744073709551615", pixel)), HasSubstr("pixels"));
  EXPECT_THAT(skyRefusal(hdr("-Y 8192 +X 16384", pixel)), HasSubstr("row 0 of 8192"));
}

TEST(ExrFile, IsReadWithAnyCompression) {
  for (const auto compression : {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
                                 Imf::PIZ_COMPRESSION, Imf::PXR24_COMPRESSION, Imf::DWAA_COMPRESSION}) {
    const auto image = read(exr(20, 10, 2.0F, compression));
    ASSERT_TRUE(image) << image.error().text();
    EXPECT_EQ(image->width, 20U);
    EXPECT_EQ(image->height, 10U);
    EXPECT_NEAR(image->texels[0].x, 2.0F, 0.1F);
    EXPECT_NEAR(image->texels.back().z, 2.0F, 0.1F);
  }
  const auto grey = read(exr(4, 2, 7.0F, Imf::ZIP_COMPRESSION, {"Y"}));
  ASSERT_TRUE(grey) << grey.error().text();
  EXPECT_EQ(grey->texels[0], glm::vec3(7.0F));
}

TEST(ExrFile, IsRefusedWithAReason) {
  const auto good = exr(64, 32, 2.0F);
  for (std::size_t cut = 4; cut < good.size(); cut += good.size() / 40) EXPECT_NE(skyRefusal(good.substr(0, cut)), "");
  for (const float wrong : {1e13F, std::numeric_limits<float>::quiet_NaN()})
    EXPECT_THAT(skyRefusal(exr(64, 32, wrong)), HasSubstr("pixel (0, 0)"));
  EXPECT_THAT(skyRefusal(exr(4, 2, 1.0F, Imf::ZIP_COMPRESSION, {"R", "G"})), HasSubstr("channels R, G and B"));
  // A data window of 4 GB and more in a kilobyte: the header alone decides.
  const auto window = good.find(std::string("dataWindow\0box2i\0", 17)) + 21;
  for (const std::int32_t edge : {40'000, std::numeric_limits<std::int32_t>::max()}) {
    auto large = good;
    std::memcpy(large.data() + window + 8, &edge, sizeof(edge));
    std::memcpy(large.data() + window + 12, &edge, sizeof(edge));
    EXPECT_THAT(skyRefusal(large), HasSubstr("a sky may have"));
  }
  auto turned = good;
  const std::int32_t before = -100;
  std::memcpy(turned.data() + window + 8, &before, sizeof(before));
  EXPECT_THAT(skyRefusal(turned), HasSubstr("no pixels"));
  auto deep = good;
  deep[5] = static_cast<char>(deep[5] | 0x08);
  EXPECT_THAT(skyRefusal(deep), HasSubstr("one part"));
}

/// An attribute as a header has it.
std::string attribute(const std::string& name, const std::string& type, const std::string& value) {
  std::string text = name + '\0' + type + '\0';
  for (unsigned shift = 0; shift < 32; shift += 8) text += static_cast<char>(value.size() >> shift & 0xFFU);
  return text + value;
}

// Who reads an attribute by what its type takes, and who by what its size says, would not agree on what comes next.
TEST(ExrFile, IsRefusedWhereItsHeaderCanBeReadInTwoWays) {
  const auto good = exr(64, 32, 2.0F);
  const auto with = [&](const std::string& more) { return good.substr(0, 8) + more + good.substr(8); };
  EXPECT_THAT(skyRefusal(with(attribute("dataWindow", "box2i", std::string(4, '\0')))), HasSubstr("dataWindow"));
  EXPECT_THAT(skyRefusal(with(attribute("dataWindow", "box2i", std::string(16, '\0')))), HasSubstr("dataWindow twice"));
  EXPECT_THAT(skyRefusal(with(attribute("screenWindowCenter", "m44d", std::string(8, '\0')))), HasSubstr("not as v2f"));
  EXPECT_THAT(skyRefusal(with(attribute("envmap", "envmap", std::string(1, '\1')))), HasSubstr("it is a cube"));
  std::string channels;
  for (int i = 0; i < 65; ++i) channels += std::string(1, static_cast<char>('0' + i)) + '\0' + std::string(16, '\0');
  EXPECT_THAT(skyRefusal(good.substr(0, 8) + attribute("channels", "chlist", channels + '\0')),
              HasSubstr("more than 64"));
  EXPECT_THAT(skyRefusal(good.substr(0, 8) + attribute("channels", "chlist", channels.substr(0, 170))),
              HasSubstr("broken"));
}

// Filters ring below 0, and a sun is beyond what halves have.
TEST(ExrFile, IsReadWithNumbersBelowZeroAndWithoutEnd) {
  const auto readWarned = [](float first, std::string& warning) {
    const auto bytes = exr(64, 32, first);
    std::vector<std::string> warnings;
    const auto image =
        readSkyFile({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "sky.exr", &warnings);
    EXPECT_TRUE(image);
    EXPECT_EQ(warnings.size(), 1U);
    if (!warnings.empty()) warning = warnings.front();
    return image ? image->texels[0].y : -1.0F;
  };
  std::string warning;
  EXPECT_EQ(readWarned(-1.0F, warning), 0.0F);
  EXPECT_THAT(warning, HasSubstr("1 pixels have numbers below 0"));
  EXPECT_EQ(readWarned(std::numeric_limits<float>::infinity(), warning), 65'504.0F);
  EXPECT_THAT(warning, HasSubstr("1 pixels have infinite numbers"));
}

// What else a header has is skipped by its size, whatever it claims of itself: the offsets of lines stay.
TEST(ExrFile, IsReadWithoutAttributesThatNobodyNeeds) {
  const auto good = exr(4, 2, 2.0F, Imf::NO_COMPRESSION, {"R", "G", "B"}, true);
  const auto preview = good.find(std::string("preview\0preview\0", 16));
  ASSERT_NE(preview, std::string::npos);
  auto hostile = good;
  const std::uint32_t edge = 1U << 15U;
  std::memcpy(hostile.data() + preview + 20, &edge, sizeof(edge));
  std::memcpy(hostile.data() + preview + 24, &edge, sizeof(edge));
  const auto image = read(hostile);
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_EQ(image->texels[0], glm::vec3(2.0F));
}

// 163 channels, or one row of tiles, of a picture of one kilobyte took gigabytes.
TEST(ExrFile, MayNotHoldManyLinesAtOnce) {
  const auto good = exr(64, 32, 2.0F);
  const auto window = good.find(std::string("dataWindow\0box2i\0", 17)) + 21;
  auto tiled = good;
  const std::int32_t right = 16'380, bottom = 8196;  // from -3 and 5 on: as large as a sky may be
  std::memcpy(tiled.data() + window + 8, &right, sizeof(right));
  std::memcpy(tiled.data() + window + 12, &bottom, sizeof(bottom));
  const std::uint32_t size[2] = {16'384, 8192};
  const std::string tile(reinterpret_cast<const char*>(size), sizeof(size));
  tiled = tiled.substr(0, 8) + attribute("tiles", "tiledesc", tile + '\0') + tiled.substr(8);
  EXPECT_THAT(skyRefusal(tiled), HasSubstr("more than 64 MiB"));
}

// What is wider than a SkyImage is reduced as it is read.
TEST(SkyFile, IsReducedAsItIsRead) {
  std::string pixels;
  for (int i = 0; i < 5000; ++i) pixels += std::string(i < 2500 ? "\x80\x80\x80\x81" : "\x80\x80\x80\x82", 4);
  const auto image = read(hdr("-Y 1 +X 5000", pixels));
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_EQ(image->width, SkyImageMaker::kMostWidth);
  EXPECT_FLOAT_EQ(image->texels.front().x, 1.0F);
  EXPECT_FLOAT_EQ(image->texels.back().x, 2.0F);
}

}  // namespace
}  // namespace radiosity::scene
