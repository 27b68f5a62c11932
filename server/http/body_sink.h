// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where a long body of a request goes, piece by piece, so that it is never in memory as a whole.
#pragma once

#include <string_view>

namespace pliant::server {

// Used by one thread at a time. One that is destroyed before the body was complete, because the
// client went or the body was refused, leaves nothing behind.
class BodySink {
 public:
  BodySink() = default;
  virtual ~BodySink() = default;
  BodySink(const BodySink&) = delete;
  BodySink& operator=(const BodySink&) = delete;

  // Called by the thread that polls all connections: must not take long. What it throws is the
  // request's answer, and the rest of the body is not read.
  virtual void Append(std::string_view bytes) = 0;
  // The complete body, where it can be looked at as a whole; as long as this is there.
  virtual std::string_view All() { return {}; }
};

}  // namespace pliant::server
