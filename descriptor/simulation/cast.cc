// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/cast.h"

#include <numeric>

namespace pliant::simulation {
namespace {

constexpr std::size_t kOthers = 5;  // pictures besides the object's that a scene uses

}  // namespace

std::size_t TextureOfScene(std::size_t count, std::uint64_t seed, std::uint64_t index) {
  auto step = static_cast<std::size_t>(0.618 * static_cast<double>(count)) + 1;
  while (std::gcd(step, count) != 1) ++step;
  return static_cast<std::size_t>((seed % count + (index % count) * step) % count);
}

Cast DrawCast(const TextureSource& textures, std::size_t own, Random& random) {
  Cast cast{textures.Get(own)};
  for (std::size_t i = 0; i < kOthers && textures.size() > 1; ++i) {
    const int step = random.Integer(1, static_cast<int>(textures.size()) - 1);
    cast.push_back(textures.Get((own + static_cast<std::size_t>(step)) % textures.size()));
  }
  return cast;
}

Cast DrawObjectCast(const TextureSource& textures, std::size_t own, std::uint64_t seed,
                    Random& random) {
  Cast cast{textures.Get(own)};
  const std::size_t count = textures.size();
  for (std::size_t i = 0; i < kOthers && count > 1; ++i) {
    const int number = random.Integer(static_cast<int>(count / 2), static_cast<int>(count) - 1);
    const std::size_t other = TextureOfScene(count, seed, static_cast<std::uint64_t>(number));
    if (other != own) cast.push_back(textures.Get(other));
  }
  return cast;
}

const Texture* AnyOther(const Cast& cast, Random& random) {
  if (cast.size() < 2) return nullptr;
  return cast[static_cast<std::size_t>(random.Integer(1, static_cast<int>(cast.size()) - 1))].get();
}

}  // namespace pliant::simulation
