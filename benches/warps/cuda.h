// Small vectors, and functions of numbers and vectors, as Metal defines them.
#pragma once
#include <cmath>
#include <cstring>

#ifdef __CUDACC__
#define DEVICE __device__ __forceinline__
#define CONSTANT static __device__ constexpr const
#else
#define DEVICE inline
#define CONSTANT static constexpr const
#define __clz(a) ((a) ? __builtin_clz(a) : 32)
#define __log2f log2f
#define __logf logf
#endif

typedef unsigned int uint;
template <class To, class From> DEVICE To bits_as(From from) {
    To to;
    memcpy(&to, &from, sizeof to);
    return to;
}

template <class T, int LENGTH> struct Array { T inner[LENGTH]; };

namespace metal {
template <class T> struct Two {
    T x, y;
    DEVICE Two() : x(), y() {}
    DEVICE Two(T x, T y) : x(x), y(y) {}
    DEVICE explicit Two(T both) : x(both), y(both) {}
};
template <class T> struct Three {
    T x, y, z;
    DEVICE Three() : x(), y(), z() {}
    DEVICE Three(T x, T y, T z) : x(x), y(y), z(z) {}
};
typedef Two<float> float2;
typedef Two<bool> bool2;
typedef Two<uint> uint2;
typedef Three<float> float3;
template <class T> struct Four {
    T x, y, z, w;
    DEVICE Four() : x(), y(), z(), w() {}
    DEVICE Four(T x, T y, T z, T w) : x(x), y(y), z(z), w(w) {}
};
typedef Four<float> float4;
struct uint3 { uint x, y, z; };

#define OPERATOR(o) \
    template <class T> DEVICE Two<T> operator o(Two<T> a, Two<T> b) { return {a.x o b.x, a.y o b.y}; } \
    template <class T> DEVICE Two<T> operator o(Two<T> a, T b) { return {a.x o b, a.y o b}; } \
    template <class T> DEVICE Two<T> operator o(T a, Two<T> b) { return {a o b.x, a o b.y}; } \
    template <class T> DEVICE Three<T> operator o(T a, Three<T> b) { return {a o b.x, a o b.y, a o b.z}; }
OPERATOR(+) OPERATOR(-) OPERATOR(*) OPERATOR(/)
DEVICE float4 operator+(float4 a, float4 b) { return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w}; }
DEVICE float4 operator*(float a, float4 b) { return {a * b.x, a * b.y, a * b.z, a * b.w}; }
DEVICE bool2 operator==(uint2 a, uint2 b) { return {a.x == b.x, a.y == b.y}; }
DEVICE uint2& operator-=(uint2& a, uint2 b) { return a = a - b; }
DEVICE bool all(bool2 b) { return b.x && b.y; }
DEVICE int abs(int a) { return a < 0 ? -a : a; }
DEVICE float abs(float a) { return fabsf(a); }
DEVICE float2 abs(float2 a) { return {fabsf(a.x), fabsf(a.y)}; }
DEVICE float max(float a, float b) { return fmaxf(a, b); }
DEVICE float min(float a, float b) { return fminf(a, b); }
template <class T> DEVICE T max(T a, T b) { return a > b ? a : b; }
template <class T> DEVICE T min(T a, T b) { return a < b ? a : b; }
template <class T> DEVICE T clamp(T a, T low, T high) { return min(max(a, low), high); }
template <class T> DEVICE T select(T a, T b, bool takes_b) { return takes_b ? b : a; }
DEVICE uint clz(uint a) { return __clz(a); }
DEVICE float log2(float a) { return __log2f(a); }
DEVICE float log(float a) { return __logf(a); }
DEVICE float exp2(float a) { return ::exp2f(a); }
DEVICE float sqrt(float a) { return ::sqrtf(a); }
DEVICE float floor(float a) { return ::floorf(a); }
DEVICE float rint(float a) { return ::rintf(a); }
DEVICE float ldexp(float a, int exponent) { return ::ldexpf(a, exponent); }
}  // namespace metal
