// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/colmap_database.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/store/sqlite/new_database.h"
#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

// https://colmap.github.io/database.html
constexpr const char* kSchema = R"(
PRAGMA user_version = 3800;
CREATE TABLE cameras (
  camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,
  prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (
  image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE,
  camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL,
  prior_tx REAL, prior_ty REAL, prior_tz REAL,
  CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (
  image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (
  image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (
  pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (
  pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
)";
constexpr int kSimpleRadial = 2;       // f, cx, cy, k
constexpr double kFocalPerSide = 1.2;  // COLMAP's ImageReader.default_focal_length_factor
constexpr std::int64_t kMostImages = 2147483647;  // COLMAP's kMaxNumImages
constexpr double kHalfPixel = 0.5;                // the first pixel's centre is (0.5, 0.5) there

template <typename Value>
std::vector<std::uint8_t> BytesOf(std::span<const Value> values) {
  std::vector<std::uint8_t> bytes(values.size_bytes());
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

class ColmapFile : public ColmapDatabase {
 public:
  ColmapFile(const fs::path& file, bool one_camera)
      : file_(file), one_camera_(one_camera), made_(file) {
    WithDatabaseErrors(file_, [&] {
      database_.emplace(made_.path().string(), SQLite::OPEN_READWRITE);
      database_->exec(kSchema);
      transaction_.emplace(*database_);
    });
  }

  int AddImage(const ColmapImage& image) override {
    return WithDatabaseErrors(file_, [&] {
      SQLite::Statement insert(*database_, "INSERT INTO images (name, camera_id) VALUES (?, ?)");
      insert.bind(1, image.name);
      insert.bind(2, CameraOf(image));
      insert.exec();
      const std::int64_t number = database_->getLastInsertRowid();
      std::vector<float> places;
      for (const Vec2& point : image.points) {
        places.push_back(static_cast<float>(point.x + kHalfPixel));
        places.push_back(static_cast<float>(point.y + kHalfPixel));
      }
      Insert("INSERT INTO keypoints VALUES (?, ?, 2, ?)", number, image.points.size(),
             BytesOf(std::span<const float>(places)));
      return static_cast<int>(number);
    });
  }

  void AddMatches(int first, int second, std::span<const PointNumbers> matches) override {
    // The smaller number first.
    const bool swapped = first > second;
    std::vector<std::uint32_t> rows;
    for (const auto& [a, b] : matches) {
      rows.push_back(swapped ? b : a);
      rows.push_back(swapped ? a : b);
    }
    const std::int64_t pair = kMostImages * std::min(first, second) + std::max(first, second);
    WithDatabaseErrors(file_, [&] {
      Insert("INSERT INTO matches VALUES (?, ?, 2, ?)", pair, matches.size(),
             BytesOf(std::span<const std::uint32_t>(rows)));
    });
  }

  void Publish() override {
    WithDatabaseErrors(file_, [&] {
      transaction_->commit();
      transaction_.reset();
      database_.reset();  // its lock would end with the file's
    });
    if (!made_.Publish(file_, NewDatabaseFile::Over::kEmptyFile)) ThrowExists(file_);
  }

  [[noreturn]] static void ThrowExists(const fs::path& file) {
    throw Error(ErrorCode::kConflict, "file_exists",
                file.string() + " exists; remove it, or name a new file");
  }

 private:
  void Insert(const char* sql, std::int64_t key, std::size_t rows,
              const std::vector<std::uint8_t>& data) {
    SQLite::Statement statement(*database_, sql);
    statement.bind(1, key);
    statement.bind(2, static_cast<std::int64_t>(rows));
    statement.bindNoCopy(3, data.data(), static_cast<int>(data.size()));
    statement.exec();
  }

  std::int64_t CameraOf(const ColmapImage& image) {
    if (camera_ != 0 && one_camera_) {
      if (image.width == width_ && image.height == height_) return camera_;
      throw Error(ErrorCode::kInvalidArgument, "sizes_vary",
                  image.name + " has " + Size(image.width, image.height) +
                      " pixels, the images before " + Size(width_, height_) +
                      ": one camera takes images of one size");
    }
    width_ = image.width;
    height_ = image.height;
    const std::array<double, 4> parameters = {kFocalPerSide * std::max(width_, height_),
                                              0.5 * width_, 0.5 * height_, 0.0};
    const std::vector<std::uint8_t> bytes = BytesOf(std::span<const double>(parameters));
    SQLite::Statement camera(*database_,
                             "INSERT INTO cameras (model, width, height, params, "
                             "prior_focal_length) VALUES (?, ?, ?, ?, 0)");
    camera.bind(1, kSimpleRadial);
    camera.bind(2, width_);
    camera.bind(3, height_);
    camera.bindNoCopy(4, bytes.data(), static_cast<int>(bytes.size()));
    camera.exec();
    camera_ = database_->getLastInsertRowid();
    return camera_;
  }

  static std::string Size(int width, int height) {
    return std::to_string(width) + " x " + std::to_string(height);
  }

  const fs::path file_;
  const bool one_camera_;
  NewDatabaseFile made_;  // before the connection, which is closed first
  std::optional<SQLite::Database> database_;
  std::optional<SQLite::Transaction> transaction_;
  std::int64_t camera_ = 0;  // the last one; 0 = none yet
  int width_ = 0, height_ = 0;
};

}  // namespace

std::unique_ptr<ColmapDatabase> CreateColmapDatabase(const fs::path& file, bool one_camera) {
  CheckParentDirectory(file);
  RemoveAbandoned(file);
  std::error_code error;
  if (fs::exists(file, error) && fs::file_size(file, error) > 0) ColmapFile::ThrowExists(file);
  return std::make_unique<ColmapFile>(fs::absolute(file), one_camera);
}

}  // namespace pliant
