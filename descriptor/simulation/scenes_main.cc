// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant-simulate-scenes: training scenes on a machine that has only a compiler. Images are read
// as PGM/PPM or from a safetensors pack; `pliant simulate` reads every type that Pliant reads.
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/base/strings.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"
#include "descriptor/simulation/scene_file.h"

namespace {

namespace sim = pliant::simulation;
namespace fs = std::filesystem;

constexpr const char* kUsage =
    "usage: pliant-simulate-scenes --textures DIR|PACK|procedural --out DIR [--preset pairs] "
    "[--scenes N]\n"
    "         [--first N] [--views N] [--width PX] [--height PX] [--seed S] [--jobs N]\n"
    "--textures takes a folder of PGM and PPM files, or a pack. To pack images of other types:\n"
    "python3 -m descriptor.simulation.pack_textures DIR PACK\n";

constexpr int kProceduralTextures = 96;

class Arguments {
 public:
  Arguments(int count, char** values) {
    for (int i = 1; i < count; i += 2) {
      const std::string name = values[i];
      if (name.rfind("--", 0) != 0 || i + 1 >= count) Fail("expected --NAME VALUE, not " + name);
      values_[name.substr(2)] = values[i + 1];
    }
  }
  [[noreturn]] static void Fail(const std::string& message) {
    throw pliant::Error(pliant::ErrorCode::kInvalidArgument, "usage", message);
  }
  std::string Text(const std::string& name, const std::string& otherwise) {
    const auto found = values_.find(name);
    if (found == values_.end()) return otherwise;
    std::string value = found->second;
    values_.erase(found);
    return value;
  }
  template <typename Value>
  Value Number(const std::string& name, Value otherwise) {
    const std::string text = Text(name, "");
    if (text.empty()) return otherwise;
    const auto value = pliant::NumberOf<Value>(text);
    if (!value) Fail("--" + name + " must be a number, not " + text);
    return *value;
  }
  void RequireAllUsed() const {
    if (!values_.empty()) Fail("unknown option --" + values_.begin()->first);
  }

 private:
  std::map<std::string, std::string> values_;
};

int Run(Arguments arguments) {
  sim::SceneOptions options;
  const fs::path textures = arguments.Text("textures", "");
  const fs::path out = arguments.Text("out", "");
  options.preset = sim::ParsePreset(arguments.Text("preset", "pairs"));
  options.views = arguments.Number("views", options.views);
  options.width = arguments.Number("width", options.width);
  options.height = arguments.Number("height", options.height);
  const auto scenes = arguments.Number<std::uint64_t>("scenes", 1);
  const auto first = arguments.Number<std::uint64_t>("first", 0);
  const auto seed = arguments.Number<std::uint64_t>("seed", 1);
  const int jobs = arguments.Number("jobs", 0);
  arguments.RequireAllUsed();
  if (textures.empty() || out.empty()) Arguments::Fail("--textures and --out are required");
  if (scenes < 1) Arguments::Fail("--scenes must be at least 1");
  if (jobs < 0) Arguments::Fail("--jobs must be at least 0 (0 = one per core)");
  sim::Validate(options);
  std::vector<sim::SkippedFile> skipped;
  const sim::TextureSource source =
      textures == "procedural" ? sim::ProceduralTextures(kProceduralTextures, seed)
                               : sim::LoadTextures(textures, sim::DecodePnm, jobs, skipped);
  for (const auto& [file, reason] : skipped)
    std::fprintf(stderr, "skipped %s: %s\n", file.c_str(), reason.c_str());
  std::error_code failed;
  fs::create_directories(out, failed);
  if (failed) Arguments::Fail("cannot create the folder " + out.string() + ": " + failed.message());
  const pliant::Stopwatch watch;
  std::atomic<std::uint64_t> images{0};
  pliant::ParallelFor(scenes, jobs, [&](std::size_t i) {
    const fs::path path = out / sim::SceneFileName(first + i);
    if (fs::exists(path)) return;  // resumes
    const sim::Scene scene = sim::MakeScene(source, options, seed, first + i);
    sim::WriteSceneFile(path, scene);
    images += scene.views.size();
  });
  const double seconds = watch.seconds();
  std::fprintf(stderr, "%llu images in %.1f s, %.2f images/s\n",
               static_cast<unsigned long long>(images), seconds,
               static_cast<double>(images) / seconds);
  return skipped.empty() ? 0 : 3;
}

}  // namespace

int main(int count, char** values) {
  if (count == 2 && std::string(values[1]) == "--help") {
    std::fputs(kUsage, stdout);
    return 0;
  }
  try {
    return Run(Arguments(count, values));
  } catch (const pliant::Error& error) {
    std::fprintf(stderr, "pliant-simulate-scenes: %s\n", error.what());
    if (error.reason() == "usage") std::fputs(kUsage, stderr);
    return error.code() == pliant::ErrorCode::kInvalidArgument ? 2 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "pliant-simulate-scenes: %s\n", error.what());
    return 1;
  }
}
