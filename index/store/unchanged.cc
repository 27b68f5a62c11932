// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/unchanged.h"

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant {
namespace {

bool OtherObject(const ImageRecord& stored, const AddRequest& request) {
  return !request.object.empty() && request.object != stored.object;
}

bool OtherMetadata(const ImageRecord& stored, const AddRequest& request) {
  return request.metadata != "{}" && request.metadata != stored.metadata;
}

[[noreturn]] void ThrowSameBytes(const ImageRecord& stored, const AddRequest& request) {
  const bool other_object = OtherObject(stored, request);
  const std::string difference = other_object
                                     ? "of object \"" + ToDisplayText(stored.object) +
                                           "\", not of \"" + ToDisplayText(request.object) + "\""
                                     : "with other metadata";
  throw Error(ErrorCode::kConflict, "same_bytes",
              "the same bytes are stored as image \"" + ToDisplayText(stored.id) + "\" " +
                  difference + "; give that id to change it, or another to store them twice");
}

}  // namespace

bool IsUnchanged(const ImageRecord& stored, const AddRequest& request, const std::string& sha256) {
  return stored.sha256 == sha256 && stored.object == request.object &&
         stored.metadata == request.metadata;
}

std::optional<ImageRecord> FindMeant(const std::vector<ImageRecord>& same_bytes,
                                     const AddRequest& request) {
  for (const ImageRecord& stored : same_bytes) {
    if (!OtherObject(stored, request) && !OtherMetadata(stored, request)) return stored;
  }
  if (!same_bytes.empty()) ThrowSameBytes(same_bytes.front(), request);
  return std::nullopt;
}

}  // namespace pliant
