// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/engine_flags.h"

#include <cerrno>
#include <fstream>
#include <system_error>

#include "descriptor/error.h"

namespace pliant::cli {

namespace fs = std::filesystem;

void AddDatabaseFlags(CLI::App& app, EngineOptions& engine, std::string& collection) {
  app.add_option("--db", engine.database, "the database file")->required()->type_name("FILE");
  app.add_option("--collection", collection, "the collection in it")
      ->default_val(kDefaultCollection)
      ->type_name("NAME");
}

void AddExtractionFlags(CLI::App& app, EngineOptions& engine) {
  std::string names;
  for (const std::string& name : DescriptorNames()) names += (names.empty() ? "" : ", ") + name;
  engine.descriptor.clear();
  app.add_option("--descriptor", engine.descriptor,
                 "what describes key points: " + names +
                     " (default: the database's own, deal for a new one)")
      ->type_name("NAME");
  app.add_option("--model", engine.descriptor_options.model_path,
                 "weight file for deal and deal-fixed")
      ->type_name("FILE");
  app.add_option("--max-keypoints", engine.extraction.keypoints.max_keypoints,
                 "strongest key points of a picture that count")
      ->capture_default_str()
      ->check(CLI::Range(1, 4096));
  app.add_option("--max-side", engine.extraction.decode.max_side_px,
                 "larger pictures are scaled down to this many pixels; 0 = never")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
}

std::vector<std::uint8_t> ReadFile(const fs::path& path, std::int64_t max_bytes) {
  const auto fail = [&](const std::string& why) {
    throw Error(ErrorCode::kNotFound, "cannot_read", path.string() + " cannot be read: " + why);
  };
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (error) fail(error.message());
  if (!fs::is_regular_file(status)) fail("it is no regular file");
  std::ifstream file(path, std::ios::binary);
  if (!file) fail(std::generic_category().message(errno));
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) fail(error.message());
  if (size > static_cast<std::uintmax_t>(max_bytes)) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                path.string() + " has " + std::to_string(size) + " bytes; the limit is " +
                    std::to_string(max_bytes));
  }
  std::vector<std::uint8_t> bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (file.bad()) fail(std::generic_category().message(errno));
  bytes.resize(static_cast<std::size_t>(file.gcount()));  // it may have shrunk meanwhile
  return bytes;
}

}  // namespace pliant::cli
