// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/db_export.h"

#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "descriptor/base/format_bytes.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"
#include "index/engine/collection_npz.h"
#include "index/files/text.h"
#include "index/json/record_json.h"

namespace pliant::cli {
namespace {

constexpr int kRecordsAtOnce = 500;

std::int64_t ExportNpz(Engine& engine, PictureListing list, const std::filesystem::path& out) {
  NewFile file(out);
  const std::int64_t images = WriteFeaturesNpz(
      engine, std::move(list), [](std::uint64_t) {},
      [&file](std::uint64_t offset, std::string_view bytes) { file.Write(offset, bytes); });
  file.Publish();
  return images;
}

std::int64_t ExportRecords(Engine& engine, PictureListing list, const std::filesystem::path& out) {
  list.limit = kRecordsAtOnce;
  std::optional<NewFile> file;
  if (out != kStandardOutput) file.emplace(out);
  std::uint64_t written = 0;
  std::int64_t images = 0;
  engine.ForEachPage(list, [&](const PicturePage& page) {
    std::string lines;
    for (const ImageRecord& record : page.records) lines += ToText(ImageJson(record)) + '\n';
    file ? file->Write(written, lines) : WriteFile(out, lines);
    written += lines.size();
    images += static_cast<std::int64_t>(page.records.size());
  });
  if (file) file->Publish();
  return images;
}

}  // namespace

void CheckExportName(const std::filesystem::path& out) {
  if (out == kStandardOutput || out.extension() == ".npz" || out.extension() == ".ndjson") return;
  throw Error(
      ErrorCode::kInvalidArgument, "bad_export_name",
      ToDisplayText(out.string()) +
          ": features are exported as .npz (NumPy), records as .ndjson; end the name in one "
          "of them, or give - for records on standard output");
}

ExitStatus RunExport(Engine& engine, const ExportOptions& options) {
  PictureListing list;
  list.which.collection = options.collection;
  list.which.object = options.object;
  if (!options.filter.empty()) list.which.filter = ParseFilter(options.filter);
  const auto write = options.out.extension() == ".npz" ? ExportNpz : ExportRecords;
  if (options.out == kStandardOutput) ClaimStandardOutput("FILE", options.json);
  const std::int64_t images = write(engine, list, options.out);
  if (options.out == kStandardOutput) {
    Message("wrote " + std::to_string(images) + " records");
    return ExitStatus::kDone;
  }
  const std::string file = ToDisplayText(options.out.string());
  const std::uintmax_t bytes = std::filesystem::file_size(options.out);
  if (options.json) {
    PrintJson({{"file", file}, {"images", images}, {"bytes", bytes}});
  } else {
    Print("wrote " + file + ", " + FormatBytes(bytes) + " of " + std::to_string(images) +
          " images");
  }
  return ExitStatus::kDone;
}

}  // namespace pliant::cli
