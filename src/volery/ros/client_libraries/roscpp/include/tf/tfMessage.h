#pragma once
#include "tf/transform_datatypes.h"
