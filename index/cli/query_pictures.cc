// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/query_pictures.h"

#include <cctype>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "index/cli/output.h"
#include "index/cli/query_drawing.h"
#include "index/cli/write_file.h"
#include "index/cli/write_picture.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxSide = 1280;  // of the pictures drawn from

DecodedImage Decode(Bytes bytes, DecodeOptions options) {
  options.max_side_px = kMaxSide;
  options.colour = true;
  return DecodeImage(bytes, options);
}

ShownHit Show(Engine& engine, const Hit& hit, const QueryPictureOptions& options) {
  ShownHit shown{hit, std::nullopt};
  try {
    shown.picture = Decode(engine.GetContent(options.collection, hit.image_id), options.decode);
  } catch (const Error& error) {
    // Not kept, or removed by another process just now: the row says so.
    if (error.code() != ErrorCode::kNotFound) throw;
  }
  return shown;
}

// "02-red-shirt.png" for the second hit, of the object "red shirt".
std::string FileName(const Hit& hit) {
  std::string name = (hit.rank < 10 ? "0" : "") + std::to_string(hit.rank) + '-';
  for (const char c : hit.object.empty() ? hit.image_id : hit.object) {
    const auto byte = static_cast<unsigned char>(c);
    name += std::isalnum(byte) != 0 || byte >= 0x80 || c == '_' || c == '.' ? c : '-';
  }
  return name.substr(0, 120) + ".png";
}

bool WriteUnwarped(Engine& engine, const DecodedImage& query, const SearchResult& result,
                   const QueryPictureOptions& options) {
  const bool one_file = options.unwarp.extension() == ".png" || options.unwarp == kStandardOutput;
  bool any = false;
  for (const Hit& hit : result.hits) {
    if (!hit.explanation || !hit.explanation->mesh) continue;
    if (!any && !one_file) {
      std::error_code error;
      fs::create_directories(options.unwarp, error);
      if (error) {
        throw Error(ErrorCode::kNoSpace, "write_failed",
                    "cannot make the folder " + ToDisplayText(options.unwarp.string()) + ": " +
                        error.message());
      }
    }
    any = true;
    WritePicture(one_file ? options.unwarp : options.unwarp / FileName(hit),
                 DrawUnwarped(query, Show(engine, hit, options)));
    if (one_file) break;
  }
  if (!any) {
    Message("skipped " + ToDisplayText(options.unwarp.string()) +
            ": no hit was verified, so there is nothing to unwarp");
  }
  return any;
}

}  // namespace

bool WriteQueryPictures(Engine& engine, Bytes query, const SearchResult& result,
                        const QueryPictureOptions& options) {
  if (options.draw.empty() && options.unwarp.empty()) return true;
  const DecodedImage decoded = Decode(query, options.decode);
  if (!options.draw.empty()) {
    std::vector<ShownHit> shown;
    for (const Hit& hit : result.hits) shown.push_back(Show(engine, hit, options));
    WritePicture(options.draw, DrawHits(decoded, shown));
  }
  return options.unwarp.empty() || WriteUnwarped(engine, decoded, result, options);
}

}  // namespace pliant::cli
