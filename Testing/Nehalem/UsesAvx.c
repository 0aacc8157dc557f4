#include <immintrin.h>

int main(int count, char** arguments) {
  volatile double memory[4] = {(double)count, 0, 0, (double)(arguments != 0)};
  __m256d sum = _mm256_loadu_pd((const double*)memory);
  sum = _mm256_add_pd(sum, sum);
  _mm256_storeu_pd((double*)memory, sum);
  return memory[0] == 0;
}
