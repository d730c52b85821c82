/* stepped.h -- a plant that is moved period by period. */
#ifndef STEPPED_H
#define STEPPED_H

typedef struct plant plant_t;

plant_t *plant_new(void);
void plant_free(plant_t *p);
double plant_output(const plant_t *p, int output);
int plant_step(plant_t *p, const double *given);

#endif
