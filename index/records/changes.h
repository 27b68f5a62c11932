// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What can change about a stored image or object without describing anything anew. Plain values.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "index/records/records.h"

namespace pliant {

// See what is there, in the transaction that changes or removes it: what they throw refuses that.
// May be called more than once.
using ImageCheck = std::function<void(const ImageRecord* now)>;  // null: there is no such image
// `image_id`: the first of the object's images in order of their ids.
using ObjectCheck = std::function<void(const ObjectRecord& now, const std::string& image_id)>;

// Absent = stays as it is.
struct ImageChange {
  std::optional<std::string> object;    // "" = none
  std::optional<std::string> metadata;  // a JSON merge patch (RFC 7396); "null" = remove all of it
  std::optional<std::string> source;
  // Sees the image as it is, in the transaction that changes it: what it throws refuses the
  // change. May be called more than once.
  std::function<void(const ImageRecord& now)> check;
};

struct CollectionChange {
  std::optional<std::string> display_name;  // "" = none
};

// By alias: the collection that it is to stand for, or nothing = it goes.
using AliasChanges = std::map<std::string, std::optional<std::string>>;

struct ObjectChange {
  std::string name;  // not empty
  // Where another object has the name: its images and these become one object. Else kConflict
  // "object_exists".
  bool merge = false;
  ObjectCheck check;
};

}  // namespace pliant
