// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files of server/web, compiled in by EmbedFiles.cmake.
#pragma once

#include <cstddef>
#include <span>

namespace pliant::server {

struct WebAsset {
  const char* path;  // where it is served
  const char* content_type;
  const char* data;
  std::size_t bytes;
  const char* sha256;  // hex
};

std::span<const WebAsset> WebAssets();

}  // namespace pliant::server
