// GoogleTest's templates of the types that most tests compare, instantiated once, in assertions.cpp: every file of
// tests has them otherwise. It is part of their precompiled header, so nobody includes it.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#define HUETRACK_PRINTED(EXTERN, T) EXTERN template std::string testing::PrintToString<T>(const T&)
#define HUETRACK_COMPARED(EXTERN, A, B)                                                                             \
  EXTERN template testing::AssertionResult testing::internal::CmpHelperOpFailure<A, B>(                             \
      const char*, const char*, const A&, const B&, const char*);                                                   \
  EXTERN template testing::AssertionResult testing::internal::CmpHelperEQ<A, B>(const char*, const char*, const A&, \
                                                                                const B&)
#define HUETRACK_ASSERTIONS(EXTERN)                                                                                \
  HUETRACK_PRINTED(EXTERN, bool);                                                                                  \
  HUETRACK_PRINTED(EXTERN, int);                                                                                   \
  HUETRACK_PRINTED(EXTERN, unsigned int);                                                                          \
  HUETRACK_PRINTED(EXTERN, long);                                                                                  \
  HUETRACK_PRINTED(EXTERN, unsigned long);                                                                         \
  HUETRACK_PRINTED(EXTERN, float);                                                                                 \
  HUETRACK_PRINTED(EXTERN, double);                                                                                \
  HUETRACK_PRINTED(EXTERN, std::string);                                                                           \
  HUETRACK_COMPARED(EXTERN, double, double);                                                                       \
  HUETRACK_COMPARED(EXTERN, double, int);                                                                          \
  HUETRACK_COMPARED(EXTERN, int, int);                                                                             \
  HUETRACK_COMPARED(EXTERN, unsigned long, unsigned int);                                                          \
  HUETRACK_COMPARED(EXTERN, unsigned long, unsigned long);                                                         \
  HUETRACK_COMPARED(EXTERN, std::string, std::string);                                                             \
  EXTERN template class testing::internal::AllOfMatcherImpl<const std::string&>;                                   \
  EXTERN template class testing::internal::ElementsAreMatcherImpl<const std::vector<std::string>&>;                \
  EXTERN template bool testing::internal::MatchPrintAndExplain<const std::string, const std::string&>(             \
      const std::string&, const testing::Matcher<const std::string&>&, testing::MatchResultListener*);             \
  EXTERN template bool                                                                                             \
  testing::internal::MatchPrintAndExplain<const std::vector<std::string>, const std::vector<std::string>&>(        \
      const std::vector<std::string>&, const testing::Matcher<const std::vector<std::string>&>&,                   \
      testing::MatchResultListener*);                                                                              \
  EXTERN template testing::AssertionResult                                                                         \
  testing::internal::PredicateFormatterFromMatcher<testing::PolymorphicMatcher<                                    \
      testing::internal::HasSubstrMatcher<std::string>>>::operator()<std::string>(const char*, const std::string&) \
      const

HUETRACK_ASSERTIONS(extern);
