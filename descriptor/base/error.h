// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The one exception type of Pliant. One place per program maps a code to an HTTP status
// (server/http/problem.h) or an exit status (index/cli/output.h).
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace pliant {

enum class ErrorCode {
  kInvalidArgument,       // a value out of range; the message names it
  kNotFound,              // no such image, object, vocabulary, file
  kConflict,              // the present state forbids it (model mismatch, name taken)
  kCorrupt,               // stored data or a model file fails its checks
  kUnsupportedMediaType,  // not an image type that Pliant reads
  kTooLarge,              // above a limit that the operator can set
  kUnprocessable,         // right type, but damaged or with too few features
  kUnavailable,           // busy; a later try can succeed
  kNoSpace,               // the disk is full, or a size limit is reached
  kCancelled,             // stopped on request; work reported as done stays done
  kInternal,              // a defect in Pliant
  kReadOnly,              // not writable: permissions, or a read-only file system
};

// Thrown by every library of Pliant. `reason()` is a stable snake_case word for programs
// ("image_truncated"); `what()` is a sentence for people that names the input and what to do.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, std::string reason, const std::string& message)
      : std::runtime_error(message), code_(code), reason_(std::move(reason)) {}

  ErrorCode code() const noexcept { return code_; }
  const std::string& reason() const noexcept { return reason_; }

 private:
  ErrorCode code_;
  std::string reason_;
};

}  // namespace pliant
