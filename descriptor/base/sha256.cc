// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/sha256.h"

#include <array>

#include <openssl/evp.h>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"

namespace pliant {

std::string Sha256Hex(std::span<const std::uint8_t> bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1) {
    throw Error(ErrorCode::kInternal, "sha256_failed", "OpenSSL could not compute a SHA-256");
  }
  return ToHex(std::span<const std::uint8_t>(digest).first(length));
}

std::string Sha256Hex(std::string_view text) {
  return Sha256Hex({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace pliant
