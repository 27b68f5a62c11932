// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The library's errors name options, the users of a program know flags. Shared with pliant-server,
// whose flags have the same names.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "descriptor/base/error.h"

namespace pliant::cli {

// The error's text with flags in place of EngineOptions' fields.
inline std::string WithFlagNames(const Error& error) {
  struct FlagName {
    std::string_view reason;  // of the errors that name the field
    std::string_view field;
    std::string_view flag;
  };
  static constexpr std::array<FlagName, 4> kNames = {
      {{"extraction_mismatch", "max_keypoints", "--max-keypoints"},
       {"extraction_mismatch", "max_side_px", "--max-side"},
       {"database_exists", "replace", "--replace"},
       {"originals_missing", "originals_dir", "--originals-dir"}}};
  std::string text = error.what();
  for (const FlagName& name : kNames) {
    const std::size_t at = text.find("with " + std::string(name.field) + " ");
    if (error.reason() != name.reason || at == std::string::npos) continue;
    text.replace(at + 5, name.field.size(), name.flag);
  }
  return text;
}

}  // namespace pliant::cli
