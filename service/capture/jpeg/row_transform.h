// The transform of inverse_transform.h in vector registers: a header, because each file that includes it is compiled
// for another instruction set.
#pragma once

#include <cstddef>

namespace huetrack::capture {
namespace {

// Loeffler, Ligtenberg and Moschytz 1989, as in libjpeg: cosines with 13 fractional bits, two more bits between the
// passes. The rotations are multiplied out: each is a sum of two products of 16 bits.
constexpr int cosine_bits = 13, between_bits = 2;
constexpr int first_shift = cosine_bits - between_bits, second_shift = cosine_bits + between_bits + 3;
constexpr int fix_0_298 = 2446, fix_0_390 = 3196, fix_0_541 = 4433, fix_0_765 = 6270, fix_0_899 = 7373,
              fix_1_175 = 9633, fix_1_501 = 12299, fix_1_847 = 15137, fix_1_961 = 16069, fix_2_053 = 16819,
              fix_2_562 = 20995, fix_3_072 = 25172;

struct Rotation {  // x a + y b, x c + y d
  int a, b, c, d;
};
constexpr Rotation even{fix_0_541 + fix_0_765, fix_0_541, fix_0_541, fix_0_541 - fix_1_847};     // rows 2, 6
constexpr Rotation sums{fix_1_175 - fix_1_961, fix_1_175, fix_1_175, fix_1_175 - fix_0_390};     // 3 + 7, 1 + 5
constexpr Rotation outer{fix_0_298 - fix_0_899, -fix_0_899, -fix_0_899, fix_1_501 - fix_0_899};  // 7, 1
constexpr Rotation inner{fix_2_053 - fix_2_562, -fix_2_562, -fix_2_562, fix_3_072 - fix_2_562};  // 5, 3

// The 16-bit numbers a, b in one of 32 bits, as pmaddwd takes them.
constexpr int pair_of_16_bits(int a, int b) {
  return static_cast<int>((static_cast<unsigned>(b) << 16) | (static_cast<unsigned>(a) & 0xFFFFU));
}

// V: a register of 16-bit numbers in lanes of eight, each lane a row of one block, and its operations (in lanes).
// V::products(x, y, a, b, low, high): x a + y b as numbers of 32 bits, of each lane's lower and upper half.
template <typename V>
class RowTransform {
 public:
  using Register = typename V::Register;
  struct Rows {  // no std::array: GCC warns of the type's attributes
    Register row[8];
  };

  // Eight columns, in place.
  template <int shift>
  [[gnu::always_inline]] static void columns(Rows& rows) {
    Register* const r = rows.row;
    const Rotated e = rotated(r[2], r[6], even);
    const Wide t0 = scaled(V::add16(r[0], r[4])), t1 = scaled(V::sub16(r[0], r[4]));
    const Rotated z = rotated(V::add16(r[3], r[7]), V::add16(r[1], r[5]), sums);
    const Rotated o = rotated(r[7], r[1], outer), i = rotated(r[5], r[3], inner);
    finish<shift>(t0 + e.first, o.second + z.second, r[0], r[7]);
    finish<shift>(t1 + e.second, i.second + z.first, r[1], r[6]);
    finish<shift>(t1 - e.second, i.first + z.second, r[2], r[5]);
    finish<shift>(t0 - e.first, o.first + z.first, r[3], r[4]);
  }

  [[gnu::always_inline]] static void transpose(Rows& rows) {
    Register* const r = rows.row;
    Rows a, b;
    for (std::size_t i = 0; i < 8; i += 2) {
      a.row[i] = V::low16(r[i], r[i + 1]);
      a.row[i + 1] = V::high16(r[i], r[i + 1]);
    }
    for (std::size_t i = 0; i < 8; i += 4) {
      b.row[i] = V::low32(a.row[i], a.row[i + 2]);
      b.row[i + 1] = V::high32(a.row[i], a.row[i + 2]);
      b.row[i + 2] = V::low32(a.row[i + 1], a.row[i + 3]);
      b.row[i + 3] = V::high32(a.row[i + 1], a.row[i + 3]);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      r[2 * i] = V::low64(b.row[i], b.row[i + 4]);
      r[2 * i + 1] = V::high64(b.row[i], b.row[i + 4]);
    }
  }

  // Row by row, as numbers around 0.
  [[gnu::always_inline]] static void both_passes(Rows& rows) {
    columns<first_shift>(rows);
    second_pass(rows);
  }
  [[gnu::always_inline]] static void second_pass(Rows& rows) {
    transpose(rows);
    columns<second_shift>(rows);
    transpose(rows);
  }

 private:
  struct Wide {  // sums of 32 bits
    Register low, high;
    [[gnu::always_inline]] Wide operator+(const Wide& w) const {
      return {V::add32(low, w.low), V::add32(high, w.high)};
    }
    [[gnu::always_inline]] Wide operator-(const Wide& w) const {
      return {V::sub32(low, w.low), V::sub32(high, w.high)};
    }
  };
  struct Rotated {
    Wide first, second;
  };

  [[gnu::always_inline]] static Rotated rotated(Register x, Register y, const Rotation& r) {
    Rotated out;
    V::products(x, y, r.a, r.b, out.first.low, out.first.high);
    V::products(x, y, r.c, r.d, out.second.low, out.second.high);
    return out;
  }
  [[gnu::always_inline]] static Wide scaled(Register x) {
    const Register zero = V::all32(0);
    return {V::template shift32<16 - cosine_bits>(V::low16(zero, x)),
            V::template shift32<16 - cosine_bits>(V::high16(zero, x))};
  }
  template <int shift>
  [[gnu::always_inline]] static Register rounded(const Wide& w) {
    const Register half = V::all32(1 << (shift - 1));
    return V::pack32(V::template shift32<shift>(V::add32(w.low, half)),
                     V::template shift32<shift>(V::add32(w.high, half)));
  }
  template <int shift>
  [[gnu::always_inline]] static void finish(const Wide& sum, const Wide& odd, Register& upper, Register& lower) {
    upper = rounded<shift>(sum + odd);
    lower = rounded<shift>(sum - odd);
  }
};

}  // namespace
}  // namespace huetrack::capture
