// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changes of names and bytes that a simulated disk has seen, and those that become durable.
#include <algorithm>
#include <cstddef>
#include <utility>

#include "tests/chaos/faults/simulated_disk.h"

namespace pliant::chaos {

std::string SimulatedDisk::FolderOf(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

void SimulatedDisk::AddName(const std::string& name, FilePtr file) {
  pending_.push_back({++last_number_, FolderOf(name), name, std::move(file), "", 0});
  ApplyTo(&live_, pending_.back());
}

void SimulatedDisk::RemoveName(const std::string& name, std::uint64_t needs) {
  pending_.push_back({++last_number_, FolderOf(name), "", nullptr, name, needs});
  ApplyTo(&live_, pending_.back());
}

// The other half of a rename out of this folder becomes durable with it.
void SimulatedDisk::FlushFolder(const std::string& folder) {
  std::set<std::uint64_t> needed;
  for (const NameChange& change : pending_) {
    if (change.folder == folder && change.needs != 0) needed.insert(change.needs);
  }
  std::erase_if(pending_, [&](const NameChange& change) {
    if (change.folder != folder && !needed.contains(change.number)) return false;
    ApplyTo(&durable_, change);
    return true;
  });
}

void SimulatedDisk::ApplyTo(Names* names, const NameChange& change) {
  if (!change.add.empty()) {
    if (change.file) {
      names->files[change.add] = change.file;
    } else {
      names->folders.insert(change.add);
    }
  }
  if (!change.remove.empty()) {
    names->files.erase(change.remove);
    names->folders.erase(change.remove);
  }
}

void SimulatedDisk::ApplyTo(Blob* bytes, const Change& change) {
  if (change.truncates) return bytes->resize(static_cast<std::size_t>(change.at));
  const auto begin = static_cast<std::size_t>(change.at);
  if (bytes->size() < begin + change.data.size()) bytes->resize(begin + change.data.size());
  std::copy(change.data.begin(), change.data.end(),
            bytes->begin() + static_cast<std::ptrdiff_t>(begin));
}

}  // namespace pliant::chaos
