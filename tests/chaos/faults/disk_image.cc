// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a simulated disk holds, and what is left of it.
#include <algorithm>
#include <fstream>
#include <random>
#include <stdexcept>

#include "tests/chaos/faults/simulated_disk.h"

namespace pliant::chaos {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kSectorBytes = 512;  // written whole or not at all

Blob ReadBytes(const fs::path& path) {
  Blob bytes(fs::file_size(path));
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) throw std::runtime_error("cannot read " + path.string());
  return bytes;
}

}  // namespace

Image ReadImage(const fs::path& folder) {
  Image image;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder).string();
    if (entry.is_directory()) {
      image.folders.insert(name);
    } else {
      image.files[name] = ReadBytes(entry.path());
    }
  }
  return image;
}

void WriteImage(const Image& image, const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) fs::remove_all(entry.path());
  for (const std::string& name : image.folders) fs::create_directories(folder / name);
  for (const auto& [name, bytes] : image.files) {
    std::ofstream file(folder / name, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    if (!file.flush()) throw std::runtime_error("cannot write " + (folder / name).string());
  }
}

Image SimulatedDisk::AfterPowerLoss(Keep keep, std::uint64_t seed) const {
  const std::lock_guard lock(mutex_);
  std::mt19937_64 random(seed);
  const auto heads = [&] { return random() % 2 == 0; };
  Names names = durable_;
  std::set<std::string> ended;  // folders whose later changes are lost
  std::set<std::uint64_t> lost;
  for (const NameChange& change : pending_) {
    if (keep == Keep::kNothing) break;
    if (keep == Keep::kPart) {
      if (lost.contains(change.needs) || random() % 4 == 0) ended.insert(change.folder);
      if (ended.contains(change.folder)) {
        lost.insert(change.number);
        continue;
      }
    }
    ApplyTo(&names, change);
  }
  Image image;
  for (const std::string& folder : names.folders) {  // in order: the one above comes first
    const std::string above = fs::path(folder).parent_path().string();
    if (above.empty() || image.folders.contains(above)) image.folders.insert(folder);
  }
  for (const auto& [name, file] : names.files) {
    const std::string above = fs::path(name).parent_path().string();
    if (!above.empty() && !image.folders.contains(above)) continue;
    if (name.ends_with("-shm")) continue;
    Blob& bytes = image.files[name] = file->durable;
    for (const Change& change : file->pending) {
      if (keep == Keep::kNothing) break;
      if (keep == Keep::kEverything) {
        ApplyTo(&bytes, change);
      } else if (change.truncates) {
        if (heads()) ApplyTo(&bytes, change);
      } else {
        const auto size = static_cast<std::int64_t>(change.data.size());
        for (std::int64_t begin = 0; begin < size;) {
          const std::int64_t end =
              std::min(size, ((change.at + begin) / kSectorBytes + 1) * kSectorBytes - change.at);
          if (heads()) {
            ApplyTo(&bytes, {false, change.at + begin,
                             Blob(change.data.begin() + begin, change.data.begin() + end)});
          }
          begin = end;
        }
      }
    }
  }
  return image;
}

}  // namespace pliant::chaos
