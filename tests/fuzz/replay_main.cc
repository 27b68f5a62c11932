// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Runs a fuzz target without libFuzzer: every file of its corpus, then mutations of them, the same
// in every run.
//
//   fuzz_TARGET CORPUS_FOLDER MUTATIONS [SEED]
//   fuzz_TARGET FILE...
//
// An input that ends the program is kept as TARGET.failed in the working folder, and its origin is
// printed.
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <unistd.h>

#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/mutator.h"

// Of the sanitizers, where there are any: they end the program without a signal.
extern "C" void __sanitizer_set_death_callback(void (*callback)()) __attribute__((weak));

namespace {

namespace fs = std::filesystem;
using pliant::fuzz::ByteVector;

constexpr unsigned kMostSeconds = 60;  // of one input: only a target that hangs takes that long

// What is run now, for the handlers below.
std::string failed_file;
std::string origin;
ByteVector input;

void KeepInput() {
  std::fprintf(stderr, "%s: kept as %s\n", origin.c_str(), failed_file.c_str());
  std::ofstream(failed_file, std::ios::binary)
      .write(reinterpret_cast<const char*>(input.data()),
             static_cast<std::streamsize>(input.size()));
}

// Allocates, which handlers should not: the program is lost anyway, and the alarm ends it if this
// hangs.
void OnSignal(int signal) {
  std::signal(signal, SIG_DFL);
  if (signal == SIGALRM) std::fprintf(stderr, "took more than %u s\n", kMostSeconds);
  std::signal(SIGALRM, SIG_DFL);
  alarm(kMostSeconds);
  KeepInput();
  std::raise(signal);
}

void Run(ByteVector bytes, std::string name) {
  input = std::move(bytes);
  origin = std::move(name);
  alarm(kMostSeconds);
  // At the end of a block of its own, so that reading beyond is seen by sanitizers.
  const ByteVector exact(input.begin(), input.end());
  if (LLVMFuzzerTestOneInput(exact.data(), exact.size()) != 0) std::abort();
}

ByteVector ReadFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    std::fprintf(stderr, "cannot read %s\n", path.c_str());
    std::exit(2);
  }
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

int RunCorpus(const fs::path& folder, std::size_t mutations, std::uint64_t seed) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  if (files.empty()) {
    std::fprintf(stderr, "%s has no files\n", folder.c_str());
    return 2;
  }
  std::vector<ByteVector> corpus;
  for (const fs::path& file : files) corpus.push_back(ReadFile(file));
  for (std::size_t i = 0; i < files.size(); ++i) Run(corpus[i], files[i].string());
  pliant::fuzz::Mutator mutator(corpus, seed);
  for (std::size_t i = 0; i < mutations; ++i) {
    const std::size_t file = i % files.size();
    Run(mutator.Mutated(corpus[file]), "mutation " + std::to_string(i) + " of seed " +
                                           std::to_string(seed) + ", from " + files[file].string());
  }
  std::printf("%zu files, %zu mutations of seed %llu\n", files.size(), mutations,
              static_cast<unsigned long long>(seed));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s CORPUS_FOLDER MUTATIONS [SEED] | FILE...\n", argv[0]);
    return 2;
  }
  failed_file = fs::path(argv[0]).filename().string() + ".failed";
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGALRM}) {
    std::signal(signal, OnSignal);
  }
  if (__sanitizer_set_death_callback != nullptr) __sanitizer_set_death_callback(KeepInput);
  if (fs::is_directory(argv[1])) {
    return RunCorpus(argv[1], argc > 2 ? std::stoul(argv[2]) : 0,
                     argc > 3 ? std::stoull(argv[3]) : 1);
  }
  for (int i = 1; i < argc; ++i) Run(ReadFile(argv[i]), argv[i]);
  return 0;
}
