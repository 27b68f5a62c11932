// The smallest program that uses an installed Pliant: DEAL descriptors of the image it is given.
#include <fstream>
#include <iostream>
#include <iterator>

#include <pliant/descriptor/features/descriptor.h>
#include <pliant/index/engine/engine.h>
#include <pliant/version.h>

int main(int, char** argv) {
  std::ifstream file(argv[1], std::ios::binary);
  const std::vector<std::uint8_t> bytes(std::istreambuf_iterator<char>(file), {});
  const pliant::FeatureExtractor extractor(pliant::MakeDescriptor("deal"), {});
  const pliant::Features features = extractor.Extract(bytes, 1);
  pliant::Engine engine({.database = argv[2]});
  engine.Add({.object = "first", .bytes = bytes});
  std::cout << features.descriptors.rows << " descriptors, " << engine.Stats().images
            << " image, version " PLIANT_VERSION "\n";
}
