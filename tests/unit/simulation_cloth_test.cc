// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The simulator's parts: cloth, solids, textures, files.
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"
#include "descriptor/simulation/motion.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3f;

std::vector<Body> AllBodies() {
  Random random(1);
  return {MakeSheet(0.7F, 24), MakeSheet(1.6F, 24), MakeTube(0.8F, 24), MakePillow(0.8F, 24),
          MakeShirt(1.0F, 24, random)};
}

TEST(SimulationCloth, ResidualStretchStaysBelowOnePercent) {
  float worst = 0.0F;
  for (const Body& body : AllBodies()) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      SCOPED_TRACE(ToString(body.kind) + " seed " + std::to_string(seed));
      Random random(seed, 77);
      const Pose pose = Perform(body, DrawMotion(body, random, 1.0F));
      EXPECT_LT(pose.stretch_p95, 0.01F) << pose.motion;
      EXPECT_FLOAT_EQ(pose.stretch_p95, StretchQuantile(body, pose.positions, 0.95F));
      worst = std::max(worst, pose.stretch_p95);
    }
  }
  RecordProperty("worst_stretch_p95", std::to_string(worst));
}

TEST(SimulationCloth, RestShapesAreUnstretched) {
  for (const Body& body : AllBodies()) {
    // Pillows and shirts start a hair's breadth apart, which stretches the seam's edges a little.
    const float limit =
        body.kind == BodyKind::kPillow || body.kind == BodyKind::kShirt ? 0.05F : 1e-4F;
    EXPECT_LT(StretchQuantile(body, body.rest, 1.0F), limit) << ToString(body.kind);
  }
}

TEST(SimulationCloth, MotionsReallyDeform) {
  const Body sheet = MakeSheet(0.75F, 24);
  int deformed = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Random random(seed, 5);
    const Pose pose = Perform(sheet, DrawMotion(sheet, random, 1.0F));
    // Corners of a sheet that bends come nearer to one another.
    const Vector3f diagonal = pose.positions.back() - pose.positions.front();
    deformed += diagonal.norm() < 0.9F * (sheet.rest.back() - sheet.rest.front()).norm() ? 1 : 0;
  }
  EXPECT_GE(deformed, 5);
}

TEST(SimulationCloth, ClothStaysOutOfSolids) {
  const Body sheet = MakeSheet(1.0F, 24);
  for (const SolidKind kind : {SolidKind::kSphere, SolidKind::kCylinder, SolidKind::kBox}) {
    Solid solid;
    solid.kind = kind;
    solid.size = Vector3f(0.2F, 0.25F, 0.2F);
    solid.centre = Vector3f(0.05F, 0.0F, 0.3F);
    Solid table;
    table.kind = SolidKind::kTable;
    table.centre.z() = 0.45F;
    ClothOptions options;
    options.gravity = Vector3f(0.0F, 0.0F, 4.0F);
    options.damping = 2.0F;
    options.solids = {solid, table};
    Cloth cloth(sheet, sheet.rest, options);
    cloth.Run(60);
    float low = 0.0F;
    for (const Vector3f& position : cloth.positions()) {
      for (const Solid& one : options.solids) {
        Vector3f normal;
        EXPECT_GT(one.Distance(position, normal), -1e-4F);
      }
      low = std::max(low, position.z());
    }
    EXPECT_GT(low, 0.2F) << "it did not fall";
  }
}

TEST(SimulationCloth, SolidDistancesLeadToTheSurface) {
  Random random(8);
  for (const SolidKind kind :
       {SolidKind::kSphere, SolidKind::kCylinder, SolidKind::kBox, SolidKind::kTable}) {
    Solid solid;
    solid.kind = kind;
    solid.size = Vector3f(0.3F, 0.5F, 0.2F);
    solid.axes =
        Eigen::AngleAxisf(0.7F, Vector3f(1.0F, 2.0F, 3.0F).normalized()).toRotationMatrix();
    for (int i = 0; i < 200; ++i) {
      const Vector3f point = random.Normal3();
      Vector3f normal, again;
      const float distance = solid.Distance(point, normal);
      EXPECT_NEAR(normal.norm(), 1.0F, 1e-5F);
      EXPECT_NEAR(solid.Distance(point - distance * normal, again), 0.0F, 1e-5F);
      // The distance never grows faster than the point moves.
      const Vector3f moved = point + 0.01F * random.Direction();
      EXPECT_LE(std::abs(solid.Distance(moved, again) - distance), 0.01F + 1e-5F);
    }
  }
}

TEST(SimulationTexture, MipLevelsAverageInLinearLight) {
  Image checks{64, 64, 1, {}};
  for (int i = 0; i < 64 * 64; ++i) checks.pixels.push_back((i / 64 + i % 64) % 2 == 0 ? 255 : 0);
  const Texture texture("checks", checks);
  EXPECT_NEAR(texture.Sample(0.5F, 0.5F, 3.0F)[0], 0.5F, 0.01F);
  EXPECT_NEAR(texture.Sample(0.13F, 0.77F, 9.0F)[1], 0.5F, 0.01F);
  // Texel centres give the texels, half way between two gives their mean.
  EXPECT_NEAR(texture.Sample(0.5F / 64, 0.5F / 64, 0.0F)[0], 1.0F, 1e-5F);
  EXPECT_NEAR(texture.Sample(1.5F / 64, 0.5F / 64, 0.0F)[0], 0.0F, 1e-5F);
  EXPECT_NEAR(texture.Sample(1.0F / 64, 0.5F / 64, 0.0F)[0], 0.5F, 1e-5F);
  Image odd{37, 51, 3, std::vector<std::uint8_t>(37 * 51 * 3, 188)};
  EXPECT_NEAR(Texture("grey", odd).Sample(0.3F, 0.9F, 2.5F)[2], LinearFromSrgb(188), 1e-4F);
}

TEST(SimulationTexture, PaintedImagesHaveContrastAndDiffer) {
  std::vector<Image> images;
  for (int kind = 0; kind < kProceduralKinds; ++kind) {
    images.push_back(PaintProcedural(static_cast<ProceduralKind>(kind), 3, 160));
    const Image& image = images.back();
    EXPECT_EQ(std::max(image.width, image.height), 160);
    double sum = 0.0;
    double squares = 0.0;
    for (const std::uint8_t value : image.pixels) {
      sum += value;
      squares += static_cast<double>(value) * value;
    }
    const auto count = static_cast<double>(image.pixels.size());
    EXPECT_GT(std::sqrt(squares / count - (sum / count) * (sum / count)), 15.0) << kind;
    EXPECT_EQ(image.pixels, PaintProcedural(static_cast<ProceduralKind>(kind), 3, 160).pixels);
    EXPECT_NE(image.pixels, PaintProcedural(static_cast<ProceduralKind>(kind), 4, 160).pixels);
  }
  EXPECT_THROW(ProceduralTextures(0, 1), Error);
}

TEST(SimulationFiles, PnmIsReadAndDamageRefused) {
  const auto decode = [](std::string text) {
    return DecodePnm({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  const Image image = decode("P6\n# a comment\n2 1\n255\nabcdef");
  EXPECT_EQ(image.width, 2);
  EXPECT_EQ(image.channels, 3);
  EXPECT_EQ(image.pixels, (std::vector<std::uint8_t>{'a', 'b', 'c', 'd', 'e', 'f'}));
  for (const std::string bad :
       {"", "P6", "P3\n1 1\n255\n0 0 0", "P5\n2 2\n255\nabc", "P5\n-2 2\n255\nabcd",
        "P5\n99999999999 2\n255\nabcd", "P5\n2 2\n65535\nabcdabcd", "P5\n30000 30000\n255\nx"}) {
    EXPECT_THROW(decode(bad), Error) << bad;
  }
}

class TemporaryFolder {
 public:
  TemporaryFolder()
      : path_(fs::temp_directory_path() / ("pliant_simulation_" + std::to_string(::getpid()))) {
    fs::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

TEST(SimulationFiles, PacksOfTexturesAreRead) {
  const TemporaryFolder folder;
  const fs::path path = folder / "pack.safetensors";
  std::vector<std::uint8_t> bytes(17 * 19 * 3);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
  ASSERT_FALSE(WriteSafetensors(path,
                                {{"a \"quoted\"\tname", "U8", {17, 19, 3}, bytes},
                                 {"other", "F32", {2}, std::vector<std::uint8_t>(8, 1)}},
                                {}));
  std::vector<SkippedFile> skipped;
  const TextureSource source = LoadTextures(path, DecodePnm, 1, skipped);
  ASSERT_EQ(source.size(), 1U);
  EXPECT_EQ(source.name(0), "a \"quoted\"\tname");
  ASSERT_EQ(skipped.size(), 1U);
  EXPECT_THAT(skipped[0].file, testing::HasSubstr("other"));
  fs::resize_file(path, fs::file_size(path) - 1);
  EXPECT_THROW(LoadTextures(path, DecodePnm, 1, skipped), Error);
}

}  // namespace
}  // namespace pliant::simulation
