#include <palpate/Palpate.h>

#include <cstdio>

int main() {
  try {
    throw palpate::Error(palpate::ErrorCode::File, "no such file");
  } catch (const palpate::Error& error) {
    std::puts(error.what());
    return error.code() == palpate::ErrorCode::File ? 0 : 1;
  }
}
