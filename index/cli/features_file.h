// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as a safetensors file (descriptor/base/safetensors.h). Tensors: `keypoints` F32 N x 6
// (x, y, size, angle, response, octave) and `descriptors` F32 or U8 N x D. Metadata: model_id,
// width, height. In NumPy:
//   import json, numpy as np
//   raw = open("f.safetensors", "rb").read(); n = int.from_bytes(raw[:8], "little")
//   header = json.loads(raw[8:8 + n]); t = header["descriptors"]; a, b = t["data_offsets"]
//   d = np.frombuffer(raw[8 + n + a:8 + n + b], {"F32": "<f4", "U8":
//   "u1"}[t["dtype"]]).reshape(t["shape"])
#pragma once

#include <filesystem>

#include "descriptor/features/features.h"

namespace pliant::cli {

// Replaces the file in one step. Throws kNoSpace "write_failed".
void WriteFeatures(const std::filesystem::path& path, const Features& features);

}  // namespace pliant::cli
