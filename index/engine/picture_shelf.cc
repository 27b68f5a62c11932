// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/picture_shelf.h"

#include <algorithm>
#include <utility>

#include "index/store/feature_codec.h"

namespace pliant {
namespace {

bool IsAdmitted(const Admission& admission, const ImageRecord& record) {
  const auto& without = admission.without;
  return std::find(without.begin(), without.end(), record.id) == without.end() &&
         (!admission.object || *admission.object == record.object) &&
         Passes(admission.filter, record.metadata);
}

}  // namespace

void PictureShelf::Fetch(std::span<const RankedPicture> pictures, Load what) {
  std::vector<PictureRef> wanted;
  for (const RankedPicture& picture : pictures) {
    const auto here = pictures_.find(picture.ref.version);
    const bool enough = here != pictures_.end() && (what == Load::kRecords || !here->second ||
                                                    !here->second->features.empty());
    if (!enough) wanted.push_back(picture.ref);
  }
  if (wanted.empty()) return;
  std::vector<std::optional<StoredPicture>> loaded = source_.LoadPictures(wanted, what);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const bool other = loaded[i] && loaded[i]->version != wanted[i].version;
    if (other && !IsAdmitted(admission_, loaded[i]->record)) loaded[i].reset();
    pictures_[wanted[i].version] = std::move(loaded[i]);
  }
}

void PictureShelf::DropFeatures() {
  for (auto& [version, picture] : pictures_) {
    if (picture) picture->features = {};
  }
}

const ImageRecord* PictureShelf::Record(std::int64_t version) const {
  const auto here = pictures_.find(version);
  return here != pictures_.end() && here->second ? &here->second->record : nullptr;
}

std::optional<Features> PictureShelf::LoadFeatures(std::int64_t version) const {
  const auto here = pictures_.find(version);
  if (here == pictures_.end() || !here->second) return std::nullopt;
  Features features = DecodeFeatures(here->second->features);
  features.model_id = model_id_;
  return features;
}

}  // namespace pliant
