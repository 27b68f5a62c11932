// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Certificates for tests.
#pragma once

#include <filesystem>

namespace pliant::testing {

// A certificate that vouches for itself, and its key, as PEM files. `names`: "IP:127.0.0.1",
// "DNS:images.test", with commas between.
void WriteCertificate(const std::filesystem::path& certificate, const std::filesystem::path& key,
                      bool rsa = false, const char* names = "IP:127.0.0.1");

}  // namespace pliant::testing
