// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/index_files.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/replace_file.h"
#include "descriptor/base/strings.h"
#include "index/files/durable_file.h"
#include "index/rank/segment_file.h"

namespace pliant {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FeedPosition, image, removal, commit, history, left_at)

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Part = IndexSnapshot::Part;
using Segment = std::shared_ptr<const IndexSegment>;

constexpr const char* kManifest = ".json";
constexpr const char* kSegment = ".segment";

struct Manifest {
  std::string signature;
  FeedPosition at;
  std::vector<std::string> segments;  // names of files
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Manifest, signature, at, segments)

// nullopt: there is none.
std::optional<Manifest> ReadManifest(const fs::path& path) {
  std::ifstream file(path);
  if (!file.is_open()) return std::nullopt;
  try {
    return Json::parse(file).get<Manifest>();
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kCorrupt, "index_damaged",
                "the index file " + path.string() + " is damaged");
  }
}

// Empty for a manifest that is missing or damaged: its signature goes with the vocabulary.
std::string SignatureIn(const fs::path& path) {
  try {
    const std::optional<Manifest> manifest = ReadManifest(path);
    return manifest ? manifest->signature : std::string();
  } catch (const Error&) {
    return {};
  }
}

FileHandle LockFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) ThrowErrno("cannot make", folder, error.value());
  FileHandle file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!file.is_open() || ::flock(file.get(), LOCK_EX) != 0) ThrowErrno("cannot lock", folder);
  return file;
}

// Those whose images lie in one file.
bool IsSaved(const Part& part, const fs::path& folder) {
  const fs::path& file = part.segment->file();
  std::error_code error;  // another process can have removed it
  return part.dead_count == 0 && file.parent_path() == folder && fs::exists(file, error);
}

// A file of fewer images is merged with others once that makes a large one. So an image is written
// twice, or three times.
bool IsLarge(std::size_t images) { return images * 2 > IndexSegment::kMaxImages; }

// Parts that become one segment each.
std::vector<std::vector<Part>> Grouped(std::vector<Part> parts) {
  std::ranges::sort(parts, std::ranges::greater{}, &Part::alive);
  std::vector<std::vector<Part>> groups;
  std::size_t alive = IndexSegment::kMaxImages;
  for (Part& part : parts) {
    if (alive + part.alive() > IndexSegment::kMaxImages) {
      groups.emplace_back();
      alive = 0;
    }
    alive += part.alive();
    groups.back().push_back(std::move(part));
  }
  return groups;
}

}  // namespace

fs::path IndexFiles::ManifestOf(Key vocabulary) const {
  return folder_ / (std::to_string(vocabulary) + kManifest);
}

std::optional<IndexFiles::Saved> IndexFiles::Read(FeedView& view, Key vocabulary,
                                                  std::size_t words) const {
  const std::optional<Manifest> manifest = ReadManifest(ManifestOf(vocabulary));
  if (!manifest || !view.IsSigned(vocabulary, manifest->signature)) return std::nullopt;
  Saved saved;
  saved.at = manifest->at;
  saved.snapshot.parts.resize(manifest->segments.size());
  ParallelFor(manifest->segments.size(), 0, [&](std::size_t i) {
    const fs::path path = folder_ / manifest->segments[i];
    saved.snapshot.parts[i].segment = SegmentFile::Map(path);
    if (saved.snapshot.parts[i].segment->codes().vocabulary_size() == words) return;
    throw Error(ErrorCode::kCorrupt, "segment_damaged",
                "the index file " + path.string() + " is of another vocabulary");
  });
  for (const Part& part : saved.snapshot.parts) saved.snapshot.images += part.alive();
  return saved;
}

void IndexFiles::Write(ChangeFeed& feed, Key vocabulary, const IndexSnapshot& snapshot,
                       const FeedPosition& at, const Exchange& exchange) {
  const FileHandle lock = LockFolder(folder_);
  Manifest manifest;
  manifest.at = at;
  std::vector<Part> unsaved;
  std::vector<Part> saved;
  std::size_t small = 0;  // images that are not in a large file
  for (const Part& part : snapshot.parts) {
    if (part.alive() == 0) continue;
    const bool is_saved = IsSaved(part, folder_);
    (is_saved ? saved : unsaved).push_back(part);
    if (!is_saved || !IsLarge(part.alive())) small += part.alive();
  }
  for (const Part& part : saved) {
    if (IsLarge(small) && !IsLarge(part.alive())) {
      unsaved.push_back(part);
    } else {
      manifest.segments.push_back(part.segment->file().filename().string());
    }
  }
  for (const std::vector<Part>& group : Grouped(std::move(unsaved))) {
    const bool as_it_is = group.size() == 1 && group[0].dead_count == 0;
    const Segment segment = as_it_is ? group[0].segment : Part::Merged(group).segment;
    RequireDiskSpace(folder_, segment->memory_bytes(), reserve_bytes_);
    const std::string name = std::to_string(vocabulary) + "-" + RandomHex(16) + kSegment;
    SegmentFile::Write(folder_ / name, *segment);
    manifest.segments.push_back(name);
    std::vector<Segment> old;
    for (const Part& part : group) old.push_back(part.segment);
    exchange(old, SegmentFile::Map(folder_ / name));
  }
  manifest.signature = RandomHex(32);
  feed.SignSaved(vocabulary, manifest.signature, SignatureIn(ManifestOf(vocabulary)));
  const std::string text = Json(manifest).dump();
  const std::array<std::string_view, 1> parts = {text};
  if (const std::error_code error = ReplaceFile(ManifestOf(vocabulary), parts)) {
    ThrowErrno("cannot write", ManifestOf(vocabulary), error.value());
  }
  RemoveUnused(feed);
}

// With the folder locked: files of interrupted and of earlier saves, and of vocabularies that the
// store does not have any more.
void IndexFiles::RemoveUnused(ChangeFeed& feed) const {
  const std::unique_ptr<FeedView> view = feed.Poll();
  std::set<std::string> used;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    files.push_back(entry.path());
    if (entry.path().extension() != kManifest) continue;
    const auto vocabulary = NumberOf<Key>(entry.path().stem().string());
    try {
      const std::optional<Manifest> manifest = ReadManifest(entry.path());
      if (!vocabulary || !manifest || !view->IsSigned(*vocabulary, manifest->signature)) continue;
      used.insert(entry.path().filename().string());
      used.insert(manifest->segments.begin(), manifest->segments.end());
    } catch (const Error&) {
      continue;  // damaged
    }
  }
  for (const fs::path& file : files) {
    std::error_code ignored;  // what cannot be removed now is removed next time
    if (!used.contains(file.filename().string())) fs::remove(file, ignored);
  }
}

}  // namespace pliant
